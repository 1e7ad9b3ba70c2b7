//! The part of the world that a picture shows, and its scale.

use nalgebra::Point2;

/// The maximum side of the maps in a picture, pixels.
const LONGEST_SIDE: f64 = 2400.0;
/// Small maps are enlarged, up to this side and this many pixels per cell.
const PREFERRED_SIDE: f64 = 2000.0;
const MOST_PIXELS_A_CELL: f64 = 8.0;
/// The maximum number of samples per pixel along each side.
const MOST_SAMPLES: f64 = 6.0;

/// The part of the world that a picture shows, without its margin.
pub(super) struct View {
    /// Pixels.
    pub(super) width: u32,
    /// Pixels.
    pub(super) height: u32,
    pub(super) metres_per_pixel: f64,
    /// The number of samples along each side of a pixel, whose mean is the pixel.
    pub(super) samples_per_side: usize,
    /// The picture's upper left corner in the world.
    left: f64,
    top: f64,
}

impl View {
    /// A length for lines and gaps in proportion to the picture, pixels.
    pub(super) fn unit(&self) -> f64 {
        (f64::from(self.width.max(self.height)) / 500.0).max(1.0)
    }

    /// The view of all outline points of `maps` maps, with the smallest resolution `finest`, metres. `None` if there
    /// are no points, or if they are too far apart.
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
        let pixels_a_cell = (PREFERRED_SIDE * finest / extent).floor().clamp(1.0, MOST_PIXELS_A_CELL);
        let metres_per_pixel = (finest / pixels_a_cell).max(extent / LONGEST_SIDE);
        // The cells of one map are aligned with the pixels; those of several are rotated and need to be smoothed.
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

    /// The world position of a pixel position, measured from the picture's upper left corner.
    pub(super) fn world(&self, u: f64, v: f64) -> Point2<f64> {
        Point2::new(self.left + u * self.metres_per_pixel, self.top - v * self.metres_per_pixel)
    }

    /// The pixel position of a world position.
    pub(super) fn pixel(&self, world: Point2<f64>) -> Point2<f64> {
        Point2::new((world.x - self.left) / self.metres_per_pixel, (self.top - world.y) / self.metres_per_pixel)
    }
}
