//! Drawn maps as the registration takes them, for its tests.

use super::comparison::MapView;
use crate::shared::test_world::floor_plan::DrawnMap;

impl DrawnMap {
    /// The map as it is compared with others.
    pub(crate) fn view(&self) -> MapView<'_> {
        MapView::rigid(self.grid(), &self.walls)
    }
}
