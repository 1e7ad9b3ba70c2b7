//! The parameters of the stage.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of the merge verifier. What takes them expects values that have passed [`check`](Parameters::check).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MergeVerifierParameters {
    /// Two walls agree when they lie within this distance, metres; never less than 1.5 cells of the coarser map.
    pub wall_tolerance: f64,
    /// The least area that both maps know, square metres.
    pub min_overlap: f64,
    /// The least length of wall on which the maps agree, metres.
    pub min_wall_length: f64,
    /// The least share of the walls seen by both maps on which they agree, 0 to 1; what is left is wall in one map and
    /// free space in the other. On maps of six buildings that were drawn from laser scans, and where the two bounds above
    /// are met, right alignments have 0.89 to 0.99, and the best of 17,000 registrations from wrong starts has 0.66.
    pub min_wall_agreement: f64,
    /// The least area that both maps know where the alignment is provisional (it rests on two tags or on the maps alone),
    /// and no other source has found the same, square metres.
    pub provisional_overlap: f64,
    /// The least length of wall on which the maps agree in this case, metres.
    pub provisional_wall_length: f64,
    /// The least share of the walls seen by both maps on which they agree in this case, 0 to 1.
    pub provisional_wall_agreement: f64,
    /// The least area that both maps know where a provisional alignment comes from a search that has looked for all other
    /// places, square metres. On 460 simulated pairs of maps, those wrong best places that met this bound and the next two
    /// all had a rival with 0.39 of their evidence or more.
    pub searched_overlap: f64,
    /// The least length of wall on which the maps agree in this case, metres.
    pub searched_wall_length: f64,
    /// The least share of the walls seen by both maps on which they agree in this case, 0 to 1.
    pub searched_wall_agreement: f64,
    /// Where a provisional alignment comes from a stage that has not looked for others itself, map b is also laid
    /// elsewhere: turned by quarter turns, and moved by up to this many metres. 0 only turns it.
    pub rival_reach: f64,
    /// At each of these other places the share of the walls that agree must be less than at the alignment by this, 0 to 1.
    pub rival_margin: f64,
    /// How much a metre of wall on free space of the other map counts against an alignment, where a metre of wall on wall
    /// counts 1 for it. What is left is its evidence, by which alignments at several places are compared.
    pub free_space_penalty: f64,
    /// The most evidence that an alignment elsewhere may have, as a share of that for a provisional alignment, 0 to 1;
    /// beyond that the place is ambiguous. An alignment that is not provisional is refused where it is the one that has no
    /// more than this share.
    pub max_rival_evidence: f64,
}

impl Default for MergeVerifierParameters {
    fn default() -> Self {
        Self {
            wall_tolerance: 0.1,
            min_overlap: 40.0,
            min_wall_length: 25.0,
            min_wall_agreement: 0.8,
            provisional_overlap: 80.0,
            provisional_wall_length: 50.0,
            provisional_wall_agreement: 0.9,
            searched_overlap: 60.0,
            searched_wall_length: 40.0,
            searched_wall_agreement: 0.85,
            rival_reach: 4.0,
            rival_margin: 0.15,
            free_space_penalty: 2.0,
            max_rival_evidence: 0.6,
        }
    }
}

/// The least that an alignment must meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Area that both maps know, square metres.
    pub overlap: f64,
    /// Length of wall on which they agree, metres.
    pub wall_length: f64,
    /// Share of the walls seen by both on which they agree, 0 to 1.
    pub wall_agreement: f64,
}

impl MergeVerifierParameters {
    /// What any alignment must meet.
    pub(super) fn bounds(&self) -> Bounds {
        Bounds { overlap: self.min_overlap, wall_length: self.min_wall_length, wall_agreement: self.min_wall_agreement }
    }

    /// What a provisional alignment must meet: less where its stage has looked for others.
    pub(super) fn provisional_bounds(&self, has_searched: bool) -> Bounds {
        let (overlap, wall_length, wall_agreement) = match has_searched {
            true => (self.searched_overlap, self.searched_wall_length, self.searched_wall_agreement),
            false => (self.provisional_overlap, self.provisional_wall_length, self.provisional_wall_agreement),
        };
        let least = self.bounds();
        Bounds {
            overlap: overlap.max(least.overlap),
            wall_length: wall_length.max(least.wall_length),
            wall_agreement: wall_agreement.max(least.wall_agreement),
        }
    }
}

impl Parameters for MergeVerifierParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if !(self.wall_tolerance.is_finite() && self.wall_tolerance > 0.0) {
            let problem = format!("must be a finite number above 0, not {}", self.wall_tolerance);
            errors.push(ParameterError::new("wall_tolerance", problem));
        }
        let not_negative = [
            ("min_overlap", self.min_overlap),
            ("min_wall_length", self.min_wall_length),
            ("provisional_overlap", self.provisional_overlap),
            ("provisional_wall_length", self.provisional_wall_length),
            ("searched_overlap", self.searched_overlap),
            ("searched_wall_length", self.searched_wall_length),
            ("rival_reach", self.rival_reach),
            ("free_space_penalty", self.free_space_penalty),
        ];
        for (field, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                errors.push(ParameterError::new(field, format!("must be a finite number from 0 up, not {value}")));
            }
        }
        // Thousands of places are tried beyond that.
        if self.rival_reach > 100.0 {
            errors.push(ParameterError::new("rival_reach", format!("must be at most 100, not {}", self.rival_reach)));
        }
        let shares = [
            ("min_wall_agreement", self.min_wall_agreement),
            ("provisional_wall_agreement", self.provisional_wall_agreement),
            ("searched_wall_agreement", self.searched_wall_agreement),
            ("rival_margin", self.rival_margin),
            ("max_rival_evidence", self.max_rival_evidence),
        ];
        for (field, value) in shares {
            if !(0.0..=1.0).contains(&value) {
                errors.push(ParameterError::new(field, format!("must lie between 0 and 1, not {value}")));
            }
        }
        errors
    }
}
