//! Doors of a path.

/// Indices of the narrow points of a path that is `widening` times wider before and after, in `clearances`, the
/// distances from the path to the nearest obstacle, step by step. Of a narrow stretch it is the middle. Doors are no
/// wider than `max_width`, in the same unit.
pub fn doors(clearances: &[f64], max_width: f64, widening: f64) -> Vec<usize> {
    let mut found = Vec::new();
    // How wide the way has been since the last narrow place, and, once it is narrow after that, where.
    let mut widest = 0.0f64;
    let mut narrowest: Option<usize> = None;
    for (step, clearance) in clearances.iter().enumerate() {
        match narrowest {
            None if *clearance * widening <= widest => narrowest = Some(step),
            None => widest = widest.max(*clearance),
            Some(least) if *clearance < clearances[least] => narrowest = Some(step),
            Some(least) if *clearance >= clearances[least] * widening => {
                let middle = middle(clearances, least);
                // A stretch that is hardly wider may reach back to the door before.
                let is_another = found.last().is_none_or(|last| middle > *last);
                if 2.0 * clearances[least] <= max_width && is_another {
                    found.push(middle);
                }
                (widest, narrowest) = (*clearance, None);
            }
            Some(_) => {}
        }
    }
    found
}

/// The middle of the stretch round a narrow place that is hardly wider.
fn middle(clearances: &[f64], narrowest: usize) -> usize {
    let is_wider = |clearance: &f64| *clearance > 1.1 * clearances[narrowest];
    let first = clearances[..narrowest].iter().rposition(is_wider).map_or(0, |wider| wider + 1);
    let behind = clearances[narrowest..].iter().position(is_wider).map_or(clearances.len(), |wider| narrowest + wider);
    (first + behind.max(1) - 1) / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn doors_follow_each_other_along_the_path(
            clearances in prop::collection::vec(0.0..1.0_f64, 0..60), widening in 1.0..2.0_f64, is_least in any::<bool>(),
        ) {
            let found = doors(&clearances, 1.6, if is_least { 1.0 } else { widening });
            prop_assert!(found.is_sorted_by(|one, next| one < next) && found.iter().all(|door| *door < clearances.len()));
        }
    }
}
