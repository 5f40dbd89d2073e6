//! Epochs whose clouds lie apart cannot be compared.

use crate::error::{Error, Result};
use crate::pipeline::graph::{About, Need, Run, Step};
use crate::pipeline::steps::ingest::{INGEST, Ingested};
use crate::settings::Align;
use stonewise_core::cloud::TileSource;
use stonewise_core::epoch::EpochId;
use stonewise_core::geometry::Bounds;

/// Stops a run whose clouds lie apart.
pub static OVERLAP: Step = Step {
    name: "overlap",
    about: About::Later,
    applies: |project, _| project.settings.registration.align == Align::None,
    needs: &[Need::reference(&INGEST), Need::same(&INGEST)],
    make: |run, epoch| run.require_overlap(epoch),
    ..Step::PLAIN
};

impl Run<'_> {
    /// Compares the boxes of the clouds of the reference and a later epoch.
    ///
    /// # Errors
    /// They lie apart.
    pub fn require_overlap(&self, later: EpochId) -> Result<()> {
        let clouds = self.clouds(later)?;
        let bounds = |t: &Ingested| {
            let tiles = (0..t.tiles.tile_count()).map(|i| t.tiles.bounds(i));
            tiles.reduce(|a, b| a.union(&b))
        };
        let [Some(first), Some(second)]: [Option<Bounds>; 2] = clouds.map(|t| bounds(&t)).into_array() else {
            return Ok(());
        };
        if first.intersects(&second) {
            return Ok(());
        }
        let names = self.context.project.epochs.pair(later).map(|e| &e.name);
        Err(Error::Survey(format!(
            "epochs {:?} and {:?} do not overlap: one reaches from {:.1?} to {:.1?} m, the other from {:.1?} to {:.1?} m; \
             are they in one frame? If not, `align = \"stones\"` under [registration] finds how they lie by their stones",
            names.first,
            names.later,
            first.min.coords.as_slice(),
            first.max.coords.as_slice(),
            second.min.coords.as_slice(),
            second.max.coords.as_slice()
        )))
    }
}
