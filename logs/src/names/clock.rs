//! Alignment of the clocks of unrelated logs.

use crate::reader::LogFile;

/// Shifts the times of files, where `input_of` is the index of the input that each file belongs to. With `align_start`,
/// all inputs start at the time of the first log. Map files, which have no time, are always moved to the start of the
/// earliest log.
pub(super) fn align(files: &mut [LogFile], input_of: &[usize], align_start: bool) {
    let start_of = |files: &[LogFile], input: usize| {
        let own = files.iter().zip(input_of).filter(|(_, of)| **of == input);
        own.filter_map(|(file, _)| file.first_time()).min()
    };
    let logs = || files.iter().zip(input_of).filter(|(file, _)| !file.is_map());
    let first_log = logs().map(|(_, input)| *input).min();
    let earliest = logs().filter_map(|(file, _)| file.first_time()).min();
    let first = first_log.filter(|_| align_start).and_then(|input| start_of(files, input));
    let later: Vec<i64> = files
        .iter()
        .zip(input_of)
        .map(|(file, &input)| {
            let to = if file.is_map() { first.or(earliest) } else { first };
            match (to, start_of(files, input)) {
                (Some(to), Some(from)) => to.wrapping_sub(from).cast_signed(),
                _ => 0,
            }
        })
        .collect();
    for (file, later) in files.iter_mut().zip(later).filter(|(_, later)| *later != 0) {
        file.set_later(later);
    }
}
