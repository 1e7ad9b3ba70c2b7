//! Methods of other authors as published, for comparison and for use in pipelines: a crate of stages as anybody may
//! write one, on what is public in the crates of Gridweave.
//!
//! - [`radon_aligner`], [`pgvd_extractor`], [`edge_matcher`], [`uncertain_transform`] and [`entropy_fuser`] are the
//!   chain of Saeedi et al., "Group mapping" (2014).
//! - [`hough_spectrum_aligner`] is Carpin, "Fast and accurate map merging for multi-robot systems" (2008).
//! - [`random_walk_aligner`] is Birk and Carpin, "Merging occupancy grid maps from multiple robots" (2006).
//!
//! The last two share [`pair_aligner`], the stage around a method that aligns two maps, and [`acceptance_index`].

#![forbid(unsafe_code)]

pub mod acceptance_index;
pub mod edge_matcher;
pub mod entropy_fuser;
pub mod hough_spectrum_aligner;
pub mod log_odds;
pub mod pair_aligner;
pub mod pgvd_extractor;
pub mod radon_aligner;
pub mod random_walk_aligner;
pub mod uncertain_transform;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this crate, by name.
pub fn kinds() -> Vec<StageKind> {
    vec![
        edge_matcher::kind(),
        entropy_fuser::kind(),
        hough_spectrum_aligner::kind(),
        pgvd_extractor::kind(),
        radon_aligner::kind(),
        random_walk_aligner::kind(),
        uncertain_transform::kind(),
    ]
}

#[cfg(test)]
mod tests {
    use gridweave::shipped;
    use gridweave_runtime::pipeline::Overrides;
    use std::path::Path;

    #[test]
    fn every_pipeline_can_be_run_with_these_kinds() {
        let registry = shipped::registry(super::kinds());
        for file in ["group_mapping.toml", "hough_spectrum.toml", "random_walk.toml"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
            if let Err(errors) = shipped::load(&path, &Overrides::default(), &registry) {
                panic!("{}", errors.render(false));
            }
        }
    }

    #[test]
    fn every_parameter_of_every_kind_can_be_set_in_a_pipeline() {
        assert_eq!(shipped::registry(super::kinds()).shadowed_parameters(), Vec::<String>::new());
    }
}
