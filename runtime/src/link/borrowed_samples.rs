//! Samples whose memory messages borrow.

use super::SampleHeader;
use crate::message::Storage;
use iceoryx2::sample::Sample;
use iceoryx2::service::Service;
use std::cell::Cell;
use std::rc::Rc;

/// The number of samples that a reader borrows.
#[derive(Clone, Debug, Default)]
pub(crate) struct BorrowedSamples(Rc<Cell<usize>>);

struct BorrowedSample<S: Service> {
    sample: Sample<S, [u8], SampleHeader>,
    count: BorrowedSamples,
}

impl<S: Service> Storage for BorrowedSample<S> {
    fn bytes(&self) -> &[u8] {
        self.sample.payload()
    }
}

impl<S: Service> Drop for BorrowedSample<S> {
    fn drop(&mut self) {
        self.count.0.set(self.count.0.get() - 1);
    }
}

impl BorrowedSamples {
    /// The bytes of a sample: the sample itself, or a copy if the reader already borrows `most` samples.
    pub(crate) fn borrow<S: Service + 'static>(
        &self,
        sample: Sample<S, [u8], SampleHeader>,
        most: usize,
    ) -> Rc<dyn Storage> {
        if self.0.get() >= most {
            return Rc::new(sample.payload().to_vec());
        }
        self.0.set(self.0.get() + 1);
        Rc::new(BorrowedSample { sample, count: self.clone() })
    }
}
