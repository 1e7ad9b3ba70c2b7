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
                if 2.0 * clearances[least] <= max_width {
                    found.push(middle(clearances, least));
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
