//! What bends do to made-up maps.
