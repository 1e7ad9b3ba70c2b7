//! The shapes of the hypotheses of all pairs of robots, and those that are to be sent when one pair has changed.
//!
//! While there are few, each message shows all, which late joiners need. Of many, it shows only those of the pair that
//! has changed, and again all once half as many were sent as there are. So no more than a few times of what is new is
//! sent, however many robots there are.

use super::hypotheses;
use super::shapes::hypothesis_shapes;
use gridweave_runtime::ros::{Alignment, Header, Marker, MarkerArray};
use std::collections::BTreeMap;

/// The number of shapes up to which each message shows all.
const FEW: usize = 300;

/// Source of hypotheses: its wire, and the pair of robots.
pub(super) type Source = (usize, String, String);

/// The hypotheses of a source, and the headers, namespaces and numbers of the shapes that show them.
#[derive(Default)]
struct OfSource {
    found: Vec<Alignment>,
    shown: Vec<(Header, String, i32)>,
}

/// The hypotheses of all pairs, and what viewers show of them.
#[derive(Default)]
pub(super) struct HypothesisMarkers {
    sources: BTreeMap<Source, OfSource>,
    /// Number of the shapes that are shown.
    shown: usize,
    /// Number of the shapes that were sent or deleted since a message showed all.
    sent: usize,
    next_id: i32,
}

impl HypothesisMarkers {
    /// Adds a hypothesis, in the place of earlier ones of its rank or higher.
    pub(super) fn push(&mut self, source: Source, hypothesis: Alignment) {
        let found = &mut self.sources.entry(source).or_default().found;
        found.truncate(hypothesis.rank as usize);
        found.push(hypothesis);
    }

    /// The message after the hypotheses of a source have changed.
    pub(super) fn changed(&mut self, source: &Source) -> MarkerArray {
        let Some(of_source) = self.sources.get_mut(source) else { return MarkerArray::default() };
        let shapes = hypothesis_shapes(of_source.found.iter());
        let (before, after) = (of_source.shown.len(), shapes.len());
        self.shown = self.shown - before + after;
        self.sent += before + after;
        if self.shown <= FEW || 2 * self.sent >= self.shown {
            return self.all();
        }
        let delete = |(header, ns, id): (Header, String, i32)| Marker {
            header,
            ns,
            id,
            action: Marker::DELETE,
            ..Marker::default()
        };
        let mut markers: Vec<Marker> = std::mem::take(&mut of_source.shown).into_iter().map(delete).collect();
        for (id, shape) in (self.next_id..).zip(shapes) {
            of_source.shown.push((shape.header.clone(), shape.ns.clone(), id));
            markers.push(Marker { id, frame_locked: true, ..shape });
        }
        self.next_id = self.next_id.saturating_add(i32::try_from(after).unwrap_or(i32::MAX));
        MarkerArray { markers }
    }

    /// A message that shows all, if the last one did not.
    pub(super) fn rest(&mut self) -> Option<MarkerArray> {
        (self.sent > 0).then(|| self.all())
    }

    fn all(&mut self) -> MarkerArray {
        let array = hypotheses(self.sources.values().flat_map(|of_source| &of_source.found));
        let mut shapes = array.markers.iter().filter(|marker| marker.action == Marker::ADD);
        for of_source in self.sources.values_mut() {
            let count = hypothesis_shapes(of_source.found.iter()).len();
            let shown = shapes.by_ref().take(count);
            of_source.shown = shown.map(|shape| (shape.header.clone(), shape.ns.clone(), shape.id)).collect();
        }
        (self.sent, self.next_id) = (0, i32::try_from(self.shown).unwrap_or(i32::MAX));
        array
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(pair: usize) -> Source {
        (0, format!("robot{pair}"), format!("robot{}", pair + 1))
    }

    fn hypothesis(rank: u32, accepted: bool, x: f64) -> Alignment {
        let header = Header { frame_id: "map".into(), ..Header::default() };
        Alignment { header, has_transform: true, rank, accepted, x, ..Alignment::default() }
    }

    /// What a viewer shows: the text or place of each shape by namespace and number.
    type Shown = BTreeMap<(String, i32), (String, String)>;

    fn view(shown: &mut Shown, message: &MarkerArray) {
        for marker in &message.markers {
            let key = (marker.ns.clone(), marker.id);
            match marker.action {
                Marker::DELETE_ALL => shown.clear(),
                Marker::DELETE => assert!(shown.remove(&key).is_some(), "{key:?} is shown"),
                _ => drop(shown.insert(key, (marker.text.clone(), format!("{:?}{:?}", marker.pose, marker.points)))),
            }
        }
    }

    #[test]
    fn a_viewer_shows_all_hypotheses_and_no_more_is_sent_than_is_new() {
        let mut markers = HypothesisMarkers::default();
        let (mut shown, mut sent, mut new) = (Shown::new(), 0, 0);
        for round in 0..4 {
            for pair in 0..1000 {
                // The number of hypotheses and their verdicts change.
                let count = 1 + (pair + round) % 3;
                for rank in 0..count {
                    markers.push(source(pair), hypothesis(rank as u32, (pair + round) % 2 == 0, (pair + rank) as f64));
                }
                let message = markers.changed(&source(pair));
                view(&mut shown, &message);
                sent += message.markers.len();
                new += 3 * count;
            }
        }
        let all = markers.all();
        let mut expected = Shown::new();
        view(&mut expected, &all);
        let values = |shown: &Shown| {
            let mut values: Vec<_> = shown.values().cloned().collect();
            values.sort();
            values
        };
        assert_eq!(values(&shown), values(&expected));
        // The first shapes are sent again and again, and each change deletes shapes.
        assert!(sent < 6 * new + FEW * FEW, "{sent} of {new}");
    }

    #[test]
    fn few_hypotheses_are_shown_by_each_message_and_many_by_the_last() {
        let mut markers = HypothesisMarkers::default();
        assert!(markers.rest().is_none());
        let is_whole = |message: &MarkerArray| message.markers[0].action == Marker::DELETE_ALL;
        let mut whole = Vec::new();
        for pair in 0..500 {
            markers.push(source(pair), hypothesis(0, true, 1.0));
            whole.push(is_whole(&markers.changed(&source(pair))));
        }
        assert!(whole[..100].iter().all(|whole| *whole));
        let after = whole[100..].iter().filter(|whole| **whole).count();
        assert!((1..5).contains(&after), "{after}");
        assert_eq!(markers.rest().unwrap().markers.len(), 1 + 3 * 500);
        assert!(markers.rest().is_none());
    }
}
