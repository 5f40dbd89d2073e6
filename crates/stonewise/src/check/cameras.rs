//! Cameras against clouds: do the edges of the projected cloud lie where the photos show them?

use super::Depth;
use super::alignment::{Overlay, Shift};
use super::finding::{Finding, Picture, Verdict};
use super::sample::Sample;
use crate::error::Result;
use crate::project::Epoch;
use crate::texts::findings::{CAMERAS, NOT_SEEN};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;
use stonewise_io::cameras::find_photos;
use stonewise_io::image_io::{image_size, read_rgb};

/// Photos that are decoded.
const PHOTOS: usize = 3;
/// Points by which photos are chosen.
const CHOOSERS: usize = 3_000;
/// A clear shift beyond this makes labels of stones fall beside them, pixels of the map; beyond the second,
/// cameras and clouds cannot belong together. Photogrammetric clouds lie off by up to 4 where a surface is
/// smoothed.
const DOUBTFUL_PX: f64 = 5.0;
/// A smaller shift is not wrong on any structure, metres.
const HARMLESS_M: f64 = 0.02;
/// Quality of the pictures.
const JPEG_QUALITY: u8 = 80;

/// One photo that was compared.
struct Compared {
    name: String,
    overlay: Overlay,
    shift: Shift,
    /// Metres on the wall that a pixel of the map stands for.
    pixel_m: f64,
}

/// Checks that photos see the cloud; at full depth, compares some photos of an epoch with its cloud, too.
pub(super) fn look(epoch: &Epoch, survey: &Sample, depth: Depth) -> Result<(Vec<Finding>, Option<Picture>)> {
    let finding = |verdict, text: String| vec![Finding::new(&epoch.name, CAMERAS.english, verdict, text)];
    let candidates = candidates(epoch, survey)?;
    if candidates.is_empty() {
        // Points that were not read may be seen.
        let verdict = match (survey.is_whole(), depth) {
            (true, _) => Verdict::Wrong,
            (false, Depth::Full) => Verdict::Doubt,
            (false, Depth::Quick) => Verdict::Note,
        };
        return Ok((finding(verdict, NOT_SEEN.say(&[])), None));
    }
    if depth == Depth::Quick {
        let text = format!("{} photos see the cloud", candidates.len());
        return Ok((finding(Verdict::Fine, text), None));
    }
    let compared: Vec<Compared> = candidates
        .into_iter()
        .filter_map(|(view, path)| compare(view, &path, survey))
        .collect();
    let Some(best) = compared
        .iter()
        .max_by(|a, b| a.shift.clearness.total_cmp(&b.shift.clearness))
    else {
        let text = "too few points or no readable photo to compare";
        return Ok((finding(Verdict::Note, text.to_owned()), None));
    };
    let (verdict, text) = judge(&compared, best);
    Ok((finding(verdict, text), picture(epoch, best)))
}

/// The photos that see most of the cloud, with a size that fits their cameras.
fn candidates(epoch: &Epoch, survey: &Sample) -> Result<Vec<(View, PathBuf)>> {
    let cameras = epoch.read_cameras()?;
    let paths = find_photos(&epoch.images, &cameras)?.paths;
    let step = (survey.points.len() / CHOOSERS).max(1);
    let some: Vec<&Point3<f64>> = survey.points.iter().step_by(step).collect();
    let sees = |view: &View| {
        let inside = |p: &&&Point3<f64>| view.project(p).is_some_and(|seen| view.is_inside(seen.pixel));
        some.iter().filter(inside).count()
    };
    let mut seen: Vec<(usize, View, PathBuf)> = cameras
        .views
        .into_iter()
        .zip(paths)
        .filter_map(|(view, path)| Some((sees(&view), view, path?)))
        .filter(|(n, _, _)| *n > 0)
        .collect();
    seen.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.name.cmp(&b.1.name)));
    let fits = |view: &View, path: &Path| {
        image_size(path).is_ok_and(|size| size == (view.camera.width, view.camera.height))
    };
    // A photo that cannot be read is named elsewhere; others that see the cloud remain.
    let any_fits = seen.iter().any(|(_, view, path)| fits(view, path));
    seen.retain(|(_, view, path)| !any_fits || fits(view, path));
    Ok(seen
        .into_iter()
        .take(PHOTOS)
        .map(|(_, view, path)| (view, path))
        .collect())
}

fn compare(view: View, path: &Path, survey: &Sample) -> Option<Compared> {
    let photo = read_rgb(path).ok()?;
    let overlay = Overlay::new(&survey.points, &view, &photo)?;
    let middle = survey.points.get(survey.points.len() / 2)?;
    let depth_m = view.project(middle).map_or(f64::NAN, |seen| seen.depth_m);
    Some(Compared {
        shift: overlay.shift(),
        pixel_m: view.gsd_m(depth_m) * overlay.reduction,
        name: view.name,
        overlay,
    })
}

/// What the shifts of an epoch's photos mean.
fn judge(compared: &[Compared], best: &Compared) -> (Verdict, String) {
    let clear: Vec<&Compared> = compared.iter().filter(|c| c.shift.is_clear()).collect();
    if clear.is_empty() {
        let text = format!(
            "the edges of the cloud are not found in {} photos (a clear fit stands out 5 times, here {:.1}): either the wall has \
             little relief, or cameras and clouds are of different surveys; look at the picture",
            compared.len(),
            best.shift.clearness
        );
        return (Verdict::Note, text);
    }
    let shift = |c: &Compared| c.shift.length();
    let is_off = |c: &&Compared, limit: f64| shift(c) > limit && shift(c) * c.pixel_m > HARMLESS_M;
    let of = |limit: f64| clear.iter().filter(|c| is_off(c, limit)).count();
    let px = best.shift.length() * best.overlay.reduction;
    let mm = 1e3 * best.shift.length() * best.pixel_m;
    let place = format!("{px:.0} px ({mm:.0} mm) off those of photo {}", best.name);
    // Sound surveys of small walls were seen with shifts of metres: the comparison informs and decides
    // nothing.
    if 2 * of(DOUBTFUL_PX) <= clear.len() {
        let text = format!("the cloud's edges fit best {place}, which light and shade can do");
        return (Verdict::Fine, text);
    }
    let advice = "cameras and clouds are not in one frame, or of different surveys; look at the picture";
    (Verdict::Note, format!("the cloud's edges lie {place}: {advice}"))
}

fn picture(epoch: &Epoch, compared: &Compared) -> Option<Picture> {
    let (width, height) = (
        compared.overlay.grey.width as u32,
        compared.overlay.grey.height as u32,
    );
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY)
        .encode(
            &compared.overlay.picture(),
            width,
            height,
            ExtendedColorType::Rgb8,
        )
        .ok()?;
    let [dx, dy] = compared.shift.map_px.map(|p| p * compared.overlay.reduction);
    let caption = match compared.shift.is_clear() {
        true => format!(
            "{}, {}: the edges fit best {dx:+.0} px to the right, {dy:+.0} px down",
            epoch.name, compared.name
        ),
        false => format!("{}, {}: the edges fit nowhere clearly", epoch.name, compared.name),
    };
    Some(Picture { caption, jpeg })
}
