//! Bringing an epoch of another frame to the reference by its stones.

use crate::error::{Error, Result};
use crate::files::{read_json, write_json};
use crate::pipeline::graph::Run;
use crate::pipeline::steps::ingest::Ingested;
use crate::pipeline::steps::label::ALIGN;
use crate::pipeline::steps::segment::Segmented;
use crate::storage::epoch_tiles::EpochTiles;
use crate::storage::step::Key;
use crate::texts::Said;
use crate::texts::notices::ALIGNED;
use crate::warnings::Warnings;
use std::sync::Arc;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::{Rigid3, View};
use stonewise_core::matching::{Alignment, align_stones};
use stonewise_core::stone::{Stone, middle};

/// File of the step.
const ALIGNMENT: &str = "alignment.json";

impl Run<'_> {
    /// The motion from the frame of an epoch's files to that of the reference; `None` where they are one.
    pub fn frame(&self, epoch: EpochId) -> Result<Option<Rigid3>> {
        if !(ALIGN.applies)(self.context.project, epoch) {
            return Ok(None);
        }
        let alignment = self.once(&ALIGN, epoch, || aligned(self, epoch))?;
        Ok(Some(alignment.first_from_second))
    }

    /// The tiles of an epoch in the frame of the reference.
    pub fn placed(&self, epoch: EpochId) -> Result<Arc<Ingested>> {
        let ingested = self.ingested(epoch)?;
        let Some(frame) = self.frame(epoch)? else {
            return Ok(ingested);
        };
        self.once(&ALIGN, epoch, || {
            let tiles = EpochTiles {
                surveyed: ingested.tiles.surveyed.in_frame(&frame),
                motion: ingested.tiles.motion.clone(),
            };
            let step = ingested.step.clone();
            Ok(Ingested { step, tiles })
        })
    }

    /// The photos of an epoch with cameras in the frame of the reference.
    pub fn posed(&self, epoch: EpochId) -> Result<Arc<Segmented>> {
        let photos = self.segmented(epoch)?;
        let Some(frame) = self.frame(epoch)? else {
            return Ok(photos);
        };
        self.once(&ALIGN, epoch, || {
            let posed = |view: &View| View {
                cam_from_world: view.cam_from_world * frame.inverse(),
                ..view.clone()
            };
            Ok(Segmented {
                step: photos.step.clone(),
                photos: photos.photos.clone(),
                views: photos.views.iter().map(posed).collect(),
            })
        })
    }
}

fn aligned(run: &Run, later: EpochId) -> Result<Alignment> {
    let context = run.context;
    let [first_votes, second_votes] = [run.voted(EpochId::REFERENCE)?, run.voted(later)?];
    let key = Key::new(
        "align",
        &context.project.settings.stones,
        &[first_votes.key().as_str(), second_votes.key().as_str()],
    );
    let step = context.step(&format!("align-{later}"), key, |step, warnings| {
        let names = context.project.epochs.pair(later).map(|e| &e.name);
        let [first, second] = [
            run.found_in_own_frame(EpochId::REFERENCE)?,
            run.found_in_own_frame(later)?,
        ];
        let alignment = align_stones(&first, &second).map_err(|reason| {
            Error::Survey(format!(
                "the stones of epoch {:?} do not show how it lies in the frame of {:?}: {reason}",
                names.later, names.first
            ))
        })?;
        tell(&alignment, &second, names.later, warnings);
        write_json(&step.file(ALIGNMENT), &alignment)
    })?;
    read_json(&step.file(ALIGNMENT))
}

fn tell(alignment: &Alignment, second: &[Stone], epoch: &str, warnings: &Warnings) {
    let motion = &alignment.first_from_second;
    let middle = middle(second);
    let degrees = motion.rotation.angle().to_degrees();
    let message = ALIGNED.say(&[
        ("stones", alignment.stones.to_string().into()),
        ("covered", alignment.covered.to_string().into()),
        ("degrees", Said::numbers(format!("{degrees:.1}"))),
        (
            "metres",
            Said::numbers(format!("{:.1}", (motion * middle - middle).norm())),
        ),
        ("rms_mm", format!("{:.0}", 1e3 * alignment.rms_m).into()),
    ]);
    warnings.notice("align", epoch, message);
}
