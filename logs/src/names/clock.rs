//! Clocks of logs that know nothing of each other, laid together.

use crate::reader::LogFile;

/// Sets the clocks of files, of which each belongs to the input of the given number: with `align_start` so that all inputs begin
/// when the first does that is a log. Map files, which know no time, begin with the earliest log in any case.
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
