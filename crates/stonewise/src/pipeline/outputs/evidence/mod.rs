//! Excerpts of the survey for the report: photo crops, sections, thinned clouds, cameras.

mod crops;
mod sections;
mod simplify;
mod thin;
mod tracks;
mod window;

use crate::error::{Error, Result};
use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::segment::Segmented;
use crate::report_params::logo_type;
use crate::results::{
    PosedPhoto, StoneOutline, StoneRow, write_cameras, write_logo, write_sections, write_thin_cloud,
};
use crops::{ShownEpoch, write_epoch_crops};
use sections::sections;
use std::collections::BTreeMap;
use thin::thin_cloud;
pub use tracks::write_tracked_stones;
use window::windows;

/// Writes `evidence/`. `pairs`: rows of each later epoch against the first.
pub fn write_evidence(
    context: &Context,
    photos: &[Segmented],
    labelled: &[Labelled],
    outlines: &BTreeMap<u32, StoneOutline>,
    pairs: &[&[StoneRow]],
) -> Result<()> {
    if let Some(logo) = &context.project.settings.report.logo {
        let media_type = logo_type(logo).map_err(Error::Survey)?;
        write_logo(&context.out, logo, media_type)?;
    }
    let windows = windows(&labelled[0].stones, outlines);
    for (i, (photos, labelled)) in photos.iter().zip(labelled).enumerate() {
        let epoch = i + 1;
        let rows = i.checked_sub(1).and_then(|later| pairs.get(later).copied());
        let posed: Vec<PosedPhoto> = photos.views.iter().map(PosedPhoto::of).collect();
        write_cameras(&context.out, epoch, &posed)?;
        let mut points = thin_cloud(context, labelled)?;
        let shown = ShownEpoch {
            number: epoch,
            photos,
            labelled,
        };
        write_epoch_crops(context, shown, &windows, rows, &mut points)?;
        let points: Vec<_> = points.into_iter().map(|p| p.point).collect();
        write_thin_cloud(&context.out, epoch, &points)?;
    }
    for (i, rows) in pairs.iter().enumerate() {
        let points = sections(context, [&labelled[0], &labelled[i + 1]], &windows, rows)?;
        write_sections(&context.out, i + 2, &points)?;
    }
    Ok(())
}
