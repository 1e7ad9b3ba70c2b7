//! What part of the world a picture shows, and how large.

use nalgebra::Point2;

/// The longest side of the maps in a picture, pixels.
const LONGEST_SIDE: f64 = 2400.0;
/// Small maps are drawn larger, up to this side and this many pixels a cell.
const PLEASANT_SIDE: f64 = 2000.0;
const MOST_PIXELS_A_CELL: f64 = 8.0;
/// Samples a pixel: along each side, at most.
const MOST_SAMPLES: f64 = 6.0;

/// The part of the world that a picture shows, without its margin.
pub(super) struct View {
    /// Pixels.
    pub(super) width: u32,
    /// Pixels.
    pub(super) height: u32,
    pub(super) metres_per_pixel: f64,
    /// Every pixel is the mean of so many samples along each side.
    pub(super) samples_per_side: usize,
    /// The picture's upper left corner in the world.
    left: f64,
    top: f64,
}

impl View {
    /// A length for lines and gaps that suits the size of the picture, pixels.
    pub(super) fn unit(&self) -> f64 {
        (f64::from(self.width.max(self.height)) / 500.0).max(1.0)
    }

    /// All points of the outlines of so many maps, of which the finest has cells of `finest` metres. `None` if there are
    /// none, or if they lie too far apart to be measured.
    pub(super) fn of(outlines: impl Iterator<Item = Point2<f64>>, maps: usize, finest: f64) -> Option<Self> {
        let mut bounds: Option<[f64; 4]> = None;
        for point in outlines {
            let [left, bottom, right, top] = bounds.unwrap_or([point.x, point.y, point.x, point.y]);
            bounds = Some([left.min(point.x), bottom.min(point.y), right.max(point.x), top.max(point.y)]);
        }
        let [left, bottom, right, top] = bounds?;
        let (extent_x, extent_y) = (right - left, top - bottom);
        let extent = extent_x.max(extent_y);
        if !(extent.is_finite() && extent > 0.0 && finest.is_finite()) {
            return None;
        }
        let pixels_a_cell = (PLEASANT_SIDE * finest / extent).floor().clamp(1.0, MOST_PIXELS_A_CELL);
        let metres_per_pixel = (finest / pixels_a_cell).max(extent / LONGEST_SIDE);
        // The cells of one map lie on the pixels; those of several lie askew and need to be smoothed.
        let least_samples = match maps {
            1 => 1.0,
            _ if pixels_a_cell >= 2.0 => 2.0,
            _ => 3.0,
        };
        let samples = (metres_per_pixel / finest * (1.0 - 1e-9)).ceil().clamp(least_samples, MOST_SAMPLES);
        let pixels = |metres: f64| (metres / metres_per_pixel * (1.0 - 1e-9)).ceil().clamp(1.0, LONGEST_SIDE) as u32;
        Some(Self {
            width: pixels(extent_x),
            height: pixels(extent_y),
            metres_per_pixel,
            samples_per_side: samples as usize,
            left,
            top,
        })
    }

    /// The place in the world of a place in the picture, pixels from its upper left corner.
    pub(super) fn world(&self, u: f64, v: f64) -> Point2<f64> {
        Point2::new(self.left + u * self.metres_per_pixel, self.top - v * self.metres_per_pixel)
    }

    /// The place in the picture of a place in the world.
    pub(super) fn pixel(&self, world: Point2<f64>) -> Point2<f64> {
        Point2::new((world.x - self.left) / self.metres_per_pixel, (self.top - world.y) / self.metres_per_pixel)
    }
}
