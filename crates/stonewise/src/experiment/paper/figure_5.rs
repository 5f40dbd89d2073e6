//! Figure 5: a photo with its stones.

use crate::error::Result;
use crate::files::read_bytes;
use crate::pipeline::{Context, Run, Until};
use crate::segmentation::outlined;
use stonewise_core::epoch::EpochId;
use stonewise_core::id::ImageId;
use stonewise_core::raster::Raster;
use stonewise_io::image_io::{read_rgb, write_jpeg};

/// Widest picture, pixels.
const WIDTH_PX: u32 = 1400;

/// The photo of the first half that shows the most stones, with their outlines: caption and JPEG. `None` where there is
/// no photo.
pub(super) fn figure_5(context: &Context) -> Result<Option<(String, Vec<u8>)>> {
    let segmented = Run::new(context, Until::Segmented).segmented(EpochId::REFERENCE)?;
    let photos = segmented.photos.iter().take(segmented.shown_count()).enumerate();
    let Some((index, photo)) = photos.max_by_key(|(i, p)| (p.instances.len(), usize::MAX - i)) else {
        return Ok(None);
    };
    let Some(labels) = segmented.labels(ImageId(index as u32))? else {
        return Ok(None);
    };
    let image = read_rgb(&photo.path)?;
    let step = image.width().div_ceil(WIDTH_PX).max(1);
    let path = context.out.join("figure_5.jpg");
    write_jpeg(&path, &outlined(&every(&image, step), &every(&labels, step)), 85)?;
    let name = photo.path.file_name().unwrap_or_default().to_string_lossy();
    let caption = format!("Figure 5: stones in {name} ({} instances)", photo.instances.len());
    Ok(Some((caption, read_bytes(&path)?)))
}

/// Every so many pixels of an image, along and down.
fn every<T: Clone + Default>(image: &Raster<T>, step: u32) -> Raster<T> {
    let (width, height) = (image.width() / step, image.height() / step);
    let mut small = Raster::filled(width, height, T::default());
    for (i, place) in (0..).zip(small.data_mut()) {
        if let Some(pixel) = image.get(i % width * step, i / width * step) {
            place.clone_from(pixel);
        }
    }
    small
}
