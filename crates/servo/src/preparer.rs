//! Preparation of strain responses, by a thread beside the loop or between the ticks of an offline run.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use palpate_core::Result;
#[cfg(feature = "strain")]
use palpate_core::simulation::StrainWatch;
use palpate_core::simulation::{MAX_BODIES, Model};
#[cfg(feature = "strain")]
use palpate_core::strain::StrainMeasure;

use crate::caller::Worker;
use crate::strain::{PreparerEnd, StrainAnswer, StrainRequest};

/// What measures the strain of the bodies of a model, as far as it is known. Built without the feature
/// `strain`, the strain of no body is limited.
#[derive(Clone)]
pub struct StrainPreparer {
    #[cfg(feature = "strain")]
    model: Arc<Model>,
    #[cfg(feature = "strain")]
    measures: [Option<Arc<StrainMeasure>>; MAX_BODIES],
}

#[cfg(feature = "strain")]
impl StrainPreparer {
    /// Knows none yet: the strain of no body is limited.
    pub fn new(model: &Arc<Model>) -> Self {
        Self { model: model.clone(), measures: Default::default() }
    }

    /// Takes the measure of a body; of one that does not exist it is left out.
    pub fn set_measure(&mut self, body: usize, measure: Arc<StrainMeasure>) {
        if let Some(place) = self.measures.get_mut(body) {
            *place = Some(measure);
        }
    }

    /// Whether the strain of each body can be limited.
    pub(crate) fn limitable(&self) -> [bool; MAX_BODIES] {
        self.measures.each_ref().map(Option::is_some)
    }

    /// `None` for a body without a measure, or contacts whose strain cannot be prepared: the bound of the tick then stays.
    pub(crate) fn prepare(&self, request: &StrainRequest) -> Option<StrainAnswer> {
        let (measure, body) = (self.measures[request.id.body].as_ref()?, self.model.bodies.get(request.id.body)?);
        let patches: Vec<_> = request.patches[..request.count].iter().map(|p| (p.nodes(), p.weights())).collect();
        let response = measure.prepare(body.green(), &patches, request.limit).ok()?;
        Some((request.id, Box::new(StrainWatch { response, serials: request.serials })))
    }
}

#[cfg(not(feature = "strain"))]
impl StrainPreparer {
    /// Knows none.
    pub fn new(_model: &Arc<Model>) -> Self {
        Self {}
    }

    pub(crate) fn limitable(&self) -> [bool; MAX_BODIES] {
        [false; MAX_BODIES]
    }

    pub(crate) fn prepare(&self, _request: &StrainRequest) -> Option<StrainAnswer> {
        None
    }
}

impl PreparerEnd {
    /// Answers one request, if there is one: of those for one body that wait behind each other the latest, for a contact that
    /// slides asks again and again.
    pub fn prepare_one(&mut self, preparer: &StrainPreparer) -> Option<Option<StrainAnswer>> {
        self.responses.free();
        let mut request = self.requests.pop().ok()?;
        while self.requests.peek().is_ok_and(|next| next.id.body == request.id.body) {
            request = self.requests.pop().ok()?;
        }
        Some(preparer.prepare(&request))
    }

    /// Hands a response to the loop. One that finds no room is lost; the tick keeps its own bound then.
    pub fn send(&mut self, response: StrainAnswer) {
        self.responses.offer(response);
    }
}

/// A thread that prepares strain responses, woken by the loop; it ends when this is dropped.
pub struct StrainWorker {
    _thread: Worker,
}

impl StrainWorker {
    /// Starts it.
    ///
    /// # Errors
    /// The operating system's.
    pub(crate) fn start(mut end: PreparerEnd, preparer: StrainPreparer) -> Result<Self> {
        let waker = end.worker.clone();
        let worker = Worker::start("palpate-strain", move |stop| {
            while !stop.load(Ordering::Acquire) {
                match end.prepare_one(&preparer) {
                    Some(Some(response)) => end.send(response),
                    Some(None) => {}
                    None => std::thread::park(),
                }
            }
        })?;
        if let Some(thread) = worker.thread() {
            let _ = waker.set(thread.clone());
        }
        Ok(Self { _thread: worker })
    }
}
