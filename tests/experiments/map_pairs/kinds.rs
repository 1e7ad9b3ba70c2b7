//! Buildings, robots and maps of many kinds: flats, offices, corridors, halls, warehouses, campuses, and buildings
//! whose parts are alike; lidars of 4 to 30 m and depth cameras; specks, deformations and moved furniture; cells of 2
//! to 25 cm.

use rand::{Rng, RngExt};

/// A kind of building.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Flat,
    Office,
    Corridor,
    Hall,
    Warehouse,
    Campus,
    Symmetric,
    Repeated,
}

impl Kind {
    pub(crate) const ALL: [Self; 8] = [
        Self::Flat,
        Self::Office,
        Self::Corridor,
        Self::Hall,
        Self::Warehouse,
        Self::Campus,
        Self::Symmetric,
        Self::Repeated,
    ];

    /// The kind of a world, by its number: each comes as often as any other.
    pub(crate) fn of(number: u64) -> Self {
        Self::ALL[(number % Self::ALL.len() as u64) as usize]
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Flat => "flats",
            Self::Office => "offices",
            Self::Corridor => "corridors",
            Self::Hall => "halls",
            Self::Warehouse => "warehouses",
            Self::Campus => "campuses",
            Self::Symmetric => "symmetric",
            Self::Repeated => "repeated rooms",
        }
    }

    /// Settings of the simulator for a random building of this kind, two robots in it, and their maps.
    pub(super) fn settings(self, random: &mut impl Rng) -> Vec<String> {
        let mut settings = vec!["robots=2".to_owned(), "tags=0".to_owned(), "snapshots=1".to_owned()];
        settings.extend(self.building(random));
        settings.extend(self.robot(random));
        settings.push(format!("overlap={:.3}", random.random::<f64>()));
        settings
    }

    fn building(self, random: &mut impl Rng) -> Vec<String> {
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let mut building = |widths: (f64, f64), heights: (f64, f64), rooms: (f64, f64), depths: (f64, f64)| {
            vec![
                format!("width={:.1}", between(widths.0, widths.1)),
                format!("height={:.1}", between(heights.0, heights.1)),
                format!("room_width={:.1}", between(rooms.0, rooms.1)),
                format!("room_depth={:.1}", between(depths.0, depths.1)),
                format!("corridor_width={:.1}", between(1.4, 3.0)),
            ]
        };
        let mut settings = match self {
            Self::Flat => building((10.0, 14.0), (9.0, 10.0), (2.5, 4.5), (4.0, 4.0)),
            Self::Corridor => building((50.0, 90.0), (9.0, 12.0), (3.0, 5.0), (4.0, 5.0)),
            Self::Hall => building((30.0, 50.0), (25.0, 45.0), (14.0, 25.0), (10.0, 16.0)),
            Self::Warehouse => building((25.0, 45.0), (25.0, 40.0), (12.0, 22.0), (10.0, 14.0)),
            Self::Campus => building((70.0, 110.0), (28.0, 50.0), (5.0, 9.0), (5.0, 8.0)),
            Self::Office | Self::Symmetric | Self::Repeated => {
                building((18.0, 40.0), (12.0, 32.0), (3.0, 7.0), (6.0, 6.0))
            }
        };
        let (layout, most_clutter) = match self {
            Self::Warehouse => ("shelves", 0.0),
            Self::Symmetric => ("symmetric", 0.1),
            Self::Repeated => ("repeated", 0.1),
            Self::Hall => ("random", 0.08),
            _ => ("random", 0.3),
        };
        settings.push(format!("layout=\"{layout}\""));
        settings.push(format!("clutter={:.2}", between(0.0, most_clutter)));
        settings
    }

    /// What the robots see by, how their poses drift, and how their maps are drawn.
    pub(super) fn robot(self, random: &mut impl Rng) -> Vec<String> {
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let is_large = matches!(self, Self::Hall | Self::Warehouse | Self::Campus);
        let has_camera = !is_large && between(0.0, 1.0) < 0.25;
        let sensor = match has_camera {
            true => ["field_of_view=1.2", "beams=160", "lidar_range=5.0"].map(str::to_owned).to_vec(),
            false => {
                let reaches = if is_large { [12.0, 16.0, 20.0, 30.0] } else { [4.0, 8.0, 12.0, 30.0] };
                vec![format!("lidar_range={}", reaches[between(0.0, 4.0) as usize])]
            }
        };
        let cells: &[&str] = match self {
            Self::Campus => &["[0.1]", "[0.1, 0.15]", "[0.2]", "[0.25, 0.1]"],
            _ if is_large => &["[0.05]", "[0.05, 0.1]", "[0.1]", "[0.2]"],
            Self::Flat => &["[0.02]", "[0.05]", "[0.05, 0.03]", "[0.1]"],
            _ => &["[0.05]", "[0.05, 0.04]", "[0.1, 0.05]", "[0.15]"],
        };
        let cells = cells[between(0.0, cells.len() as f64) as usize];
        // Half of the worlds have each of these.
        let mut half = |most: f64| if between(0.0, 1.0) < 0.5 { between(0.0, most) } else { 0.0 };
        let (specks, moved) = (half(0.004), half(0.6));
        let more = [
            format!("lidar_noise={:.3}", between(0.005, 0.04)),
            format!("dropped_beams={:.2}", between(0.0, 0.2)),
            format!("drift={:.5}", between(0.0, 0.008)),
            format!("resolution={cells}"),
            format!("specks={specks:.5}"),
            format!("moved={moved:.2}"),
        ];
        sensor.into_iter().chain(more).collect()
    }
}
