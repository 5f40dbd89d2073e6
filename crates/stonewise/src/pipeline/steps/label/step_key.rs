//! Name and key of the step, which whole epochs and batches share.

use crate::pipeline::context::Context;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::steps::segment::Segmented;
use crate::storage::step::Key;
use stonewise_core::epoch::EpochId;

/// Name of the step.
pub fn label_name(epoch: EpochId) -> String {
    format!("label-{epoch}")
}

/// Its key.
pub fn label_key(context: &Context, epoch: EpochId, ingested: &Ingested, photos: &Segmented) -> Key {
    let params = &context.project.settings.label;
    let map = &context.project.epochs[epoch].map;
    let geoid = map.geoid.as_deref().and_then(|path| context.digest(path).ok());
    Key::new(
        "label",
        &(params, &map.crs, map.false_origin, geoid),
        &[ingested.step.key().as_str(), photos.step.key().as_str()],
    )
}
