//! The colours of robots, in pictures and viewers alike.

/// Colours that people with any kind of colour vision distinguish (Okabe and Ito, 2008), those that are dark enough
/// for lines on white first.
const PALETTE: [[u8; 3]; 6] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233]];

/// The colour (red, green, blue) of the robot at a place in the list; after six they start again.
pub fn robot_colour(index: usize) -> [u8; 3] {
    PALETTE[index % PALETTE.len()]
}
