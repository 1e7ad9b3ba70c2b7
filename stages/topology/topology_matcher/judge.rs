//! Whether the best place of two topological maps is used.

use super::{Place, Topology, TopologyMatcherParameters};

/// What was made of the places of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Whether the best place is used.
    pub accepted: bool,
    /// The share of the paths of the map with fewer that coincide with paths of the other at the best place, 0 to 1.
    pub score: f64,
    /// What speaks for it, or against it.
    pub reason: String,
}

/// Judges the best place by the share of paths that coincide there, and by how many coincide elsewhere. `places` are those of
/// map b on map a, the best first.
///
/// The published methods take whatever is best. Here the best place must have enough paths on paths, and clearly more than
/// any other: maps of places that have nothing in common, and of places that look alike, have none that stands out. It is no
/// check against the walls, and it can be wrong.
pub fn judge(a: &Topology, b: &Topology, places: &[Place], parameters: &TopologyMatcherParameters) -> Judgement {
    let count = |map: &Topology| map.long_paths(parameters.tolerance).count();
    let fewer = count(a).min(count(b));
    let Some(best) = places.first() else {
        let reason = match fewer {
            0 => "a topological map has no path that is longer than twice the tolerance",
            _ => "no paths of the topological maps coincide anywhere\ntry: drive one robot on where the other was",
        };
        return Judgement { accepted: false, score: 0.0, reason: reason.into() };
    };
    let score = (best.similarity as f64 / fewer.max(1) as f64).min(1.0);
    let elsewhere = places.get(1).map_or(0, |place| place.similarity);
    let found = format!(
        "{} of {fewer} paths coincide at the best place, and {elsewhere} at the best other place",
        best.similarity
    );
    let missing = if best.similarity < parameters.min_paths {
        Some(format!("missing: {} paths that coincide (min_paths)", parameters.min_paths))
    } else if score < parameters.min_share {
        Some(format!("missing: {:.0} % of the paths (min_share)", 100.0 * parameters.min_share))
    } else if elsewhere as f64 > parameters.max_runner_up * best.similarity as f64 {
        let most = 100.0 * parameters.max_runner_up;
        Some(format!("missing: at most {most:.0} % of as many paths at any other place (max_runner_up)"))
    } else {
        None
    };
    let reason = match &missing {
        Some(missing) => format!("{found}\n{missing}\ntry: drive one robot on where the other was"),
        None => found,
    };
    Judgement { accepted: missing.is_none(), score, reason }
}
