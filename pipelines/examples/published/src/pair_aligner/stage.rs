//! The stage of a method: maps in, hypotheses for every pair of robots out.

use super::{Criterion, RatedPose};
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use gridweave_stages::registration::search::{NamedMap, SearchRefusal};
use gridweave_stages::shared::geometry::{Grid, row_by_row};
use gridweave_stages::shared::robot_maps::RobotMaps;

/// A method to align two maps.
pub trait Method {
    /// Name of the method in alignments.
    const NAME: &'static str;

    /// Relative poses of map b in map a, in any order.
    ///
    /// # Errors
    /// Maps on which the method cannot work.
    fn align(&self, a: &NamedMap<'_>, b: &NamedMap<'_>) -> Result<Vec<RatedPose>, SearchRefusal>;

    /// Criterion by which the best of them is accepted.
    fn criterion(&self) -> Criterion;

    /// Largest number of them that is sent.
    fn max_hypotheses(&self) -> usize;
}

/// Outputs of the stage.
pub struct Found {
    alignment: Out<Alignment>,
    hypotheses: Out<Alignment>,
}

impl Outputs for Found {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            alignment: ports.output(
                "alignment",
                "The best hypothesis for each pair of robots, accepted or refused by its acceptance index omega, which is its score; or why \
                 there is none. Sent at the end.",
            ),
            hypotheses: ports.output(
                "hypotheses",
                "The best few hypotheses for each pair of robots, ranked by omega and marked as provisional: for icp_refiner and \
                 merge_verifier. Nothing where there is none.",
            ),
        }
    }
}

/// Keeps each robot's last map, and aligns those of every pair when all have arrived.
pub struct PairAligner<M> {
    method: M,
    maps: RobotMaps<()>,
}

impl<M: Method> PairAligner<M> {
    /// The stage of a method.
    pub fn new(method: M) -> Self {
        Self { method, maps: RobotMaps::default() }
    }

    /// Stores a map.
    ///
    /// # Errors
    /// None: an invalid map gives a warning.
    pub fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Found>,
    ) -> Result<(), StageError> {
        self.maps.keep(&map, output, |_: &Grid<'_>| ());
        Ok(())
    }

    /// Aligns the maps of all pairs, by name.
    ///
    /// # Errors
    /// A message cannot be sent.
    pub fn finish(&mut self, output: &Output<Found>) -> Result<(), StageError> {
        for (place, (a, map_a)) in self.maps.iter().enumerate() {
            for (b, map_b) in self.maps.iter().skip(place + 1) {
                let of_pair = Alignment {
                    header: Header::new(output.log_time(), map_a.frame_id.clone()),
                    a: a.to_owned(),
                    b: b.to_owned(),
                    source: "maps".into(),
                    method: M::NAME.into(),
                    ..Alignment::default()
                };
                let (a, b) = (NamedMap { robot: a, grid: map_a.grid() }, NamedMap { robot: b, grid: map_b.grid() });
                match self.method.align(&a, &b) {
                    Ok(found) => self.send(of_pair, found, output)?,
                    Err(refusal) => {
                        output.alignment.send("", &Alignment { reason: refusal.to_string(), ..of_pair })?;
                    }
                }
            }
        }
        Ok(())
    }

    fn send(&self, of_pair: Alignment, mut found: Vec<RatedPose>, output: &Output<Found>) -> Result<(), StageError> {
        let criterion = self.method.criterion();
        criterion.rank(&mut found);
        found.truncate(self.method.max_hypotheses());
        let judgement = criterion.judge(&found);
        let (accepted, reason) = (judgement.accepted, judgement.reason);
        let Some(best) = found.first() else {
            return output.alignment.send("", &Alignment { reason, ..of_pair });
        };
        output.alignment.send("", &Alignment { accepted, reason, ..at(best, &of_pair) })?;
        let hypotheses = found.len() as u32;
        for (rank, one) in (0..).zip(&found) {
            let reason = format!(
                "the maps alone: omega {:.3}, where {:.0} % of the smaller map overlap",
                one.index.omega(),
                100.0 * one.overlap
            );
            let guess = Alignment { accepted: true, provisional: true, rank, hypotheses, reason, ..at(one, &of_pair) };
            output.hypotheses.send("", &guess)?;
        }
        Ok(())
    }
}

fn at(found: &RatedPose, of_pair: &Alignment) -> Alignment {
    let mut alignment =
        Alignment { covariance: row_by_row(&found.covariance), score: found.index.omega(), ..of_pair.clone() };
    alignment.set_transform_a_b(&found.transform_a_b);
    alignment
}
