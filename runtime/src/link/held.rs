//! Samples that messages borrow from.

use super::SampleHeader;
use crate::message::Storage;
use iceoryx2::sample::Sample;
use iceoryx2::service::Service;
use std::cell::Cell;
use std::rc::Rc;

/// Counts the samples that a reader holds.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldSamples(Rc<Cell<usize>>);

struct Held<S: Service> {
    sample: Sample<S, [u8], SampleHeader>,
    held: HeldSamples,
}

impl<S: Service> Storage for Held<S> {
    fn bytes(&self) -> &[u8] {
        self.sample.payload()
    }
}

impl<S: Service> Drop for Held<S> {
    fn drop(&mut self) {
        self.held.0.set(self.held.0.get() - 1);
    }
}

impl HeldSamples {
    /// The bytes of a sample: the sample itself, or a copy of them if the reader holds `most` already.
    pub(crate) fn hold<S: Service + 'static>(
        &self,
        sample: Sample<S, [u8], SampleHeader>,
        most: usize,
    ) -> Rc<dyn Storage> {
        if self.0.get() >= most {
            return Rc::new(sample.payload().to_vec());
        }
        self.0.set(self.0.get() + 1);
        Rc::new(Held { sample, held: self.clone() })
    }
}
