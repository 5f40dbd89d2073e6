//! Excerpts of the survey for the report: photo crops, sections, thinned clouds, cameras.

mod crops;
mod sections;
mod thin;
mod tracks;
mod window;

use crate::error::{Error, Result};
use crate::files::write_json;
use crate::pipeline::graph::{Need, Phase, Run, Step};
use crate::pipeline::steps::measure::MEASURE;
use crate::pipeline::until::Until;
use crate::report_params::logo_type;
use crate::results::names::PROFILE;
use crate::results::{PosedPhoto, write_cameras, write_logo, write_sections, write_thin_cloud};
use crops::{ShownEpoch, write_epoch_crops};
use sections::sections;
use stonewise_base::profile::Profile;
use stonewise_core::epoch::EpochId;
use thin::thin_cloud;
pub use tracks::write_tracked_stones;
use window::windows;

/// Writes `evidence/`.
pub static EVIDENCE: Step = Step {
    name: "evidence",
    phase: Some(Phase::Write),
    needs: &[Need::all(&MEASURE)],
    wanted: |until| until == Until::Reported,
    make: |run, _| {
        let write = || run.context.timed("evidence", || write_evidence(run));
        run.once(&EVIDENCE, EpochId::REFERENCE, write).map(drop)
    },
    ..Step::PLAIN
};

fn write_evidence(run: &Run) -> Result<()> {
    let (context, out) = (run.context, &run.context.out);
    if let Some(logo) = &context.project.settings.report.logo {
        let media_type = logo_type(logo).map_err(Error::Survey)?;
        write_logo(out, logo, media_type)?;
    }

    let first = run.labelled(EpochId::REFERENCE)?;
    let windows = windows(&first.stones, &run.outlined()?.outlines);
    for epoch in context.project.epochs.ids() {
        let (photos, labelled) = (run.posed(epoch)?, run.labelled(epoch)?);
        let measured = match epoch.is_reference() {
            true => None,
            false => Some(run.measured(epoch)?),
        };
        let shown = &photos.views[..photos.shown_count()];
        let posed: Vec<PosedPhoto> = shown.iter().map(PosedPhoto::of).collect();
        write_cameras(out, epoch.number(), &posed)?;
        let mut points = thin_cloud(context, &labelled)?;
        let shown = ShownEpoch {
            epoch,
            photos: &photos,
            labelled: &labelled,
        };
        let rows = measured.as_ref().map(|m| m.rows.as_slice());
        write_epoch_crops(context, shown, &windows, rows, &mut points)?;
        let points: Vec<_> = points.into_iter().map(|p| p.point).collect();
        write_thin_cloud(out, epoch.number(), &points)?;
    }

    for later in context.project.epochs.later_ids() {
        let labelled = run.labelled_pair(later)?;
        let labelled = labelled.each_ref().map(|l| &**l);
        let points = sections(context, labelled, &windows, &run.measured(later)?.rows)?;
        write_sections(out, later.number(), &points)?;
    }

    let profile = &context.project.settings.report.profile;
    if Profile::shipped(profile).is_none() {
        write_json(&out.join(PROFILE), &Profile::read(profile)?)?;
    }
    Ok(())
}
