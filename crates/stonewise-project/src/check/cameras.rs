//! Cameras against clouds: do the edges of the projected cloud lie where the photos show them?

use super::Depth;
use super::alignment::{Overlay, Shift};
use super::finding::{Finding, Picture, Verdict};
use super::photos::PosedPhoto;
use super::sample::Sample;
use crate::Epoch;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::{Point3, Rotation3, Vector3};
use std::path::Path;
use stonewise_base::error::Result;
use stonewise_base::messages::Said;
use stonewise_base::messages::findings::{CAMERAS, NOT_SEEN};
use stonewise_core::geometry::View;
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
/// Photos whose shifts differ by less than this share of their length show the same shift.
const SAME_SHIFT: f64 = 0.25;
/// Quality of the pictures.
const JPEG_QUALITY: u8 = 80;

/// One photo that was compared.
struct Compared {
    name: String,
    overlay: Overlay,
    shift: Shift,
    /// Metres on the wall that a pixel of the map stands for.
    pixel_m: f64,
    across: Across,
}

/// A shift that a photo shows.
#[derive(Clone, Copy)]
struct Across {
    /// Across the line of sight, world, metres.
    shift_m: Vector3<f64>,
    /// Line of sight, world.
    sight: Vector3<f64>,
}

/// Checks that photos see the cloud; at full depth, compares some photos of an epoch with its cloud, too.
pub(super) fn look(
    epoch: &Epoch,
    photos: &[PosedPhoto],
    survey: &Sample,
    depth: Depth,
) -> Result<(Vec<Finding>, Option<Picture>)> {
    // Photos that are not there are named elsewhere.
    if photos.is_empty() {
        return Ok((Vec::new(), None));
    }
    let finding = |verdict, text: Said| vec![Finding::new(&epoch.name, &CAMERAS, verdict, text)];
    let candidates = candidates(photos, survey);

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
        let text = match candidates.len() {
            1 => "1 photo sees the cloud".to_owned(),
            n => format!("{n} photos see the cloud"),
        };
        return Ok((finding(Verdict::Fine, text.into()), None));
    }

    let compared: Vec<Compared> = candidates
        .into_iter()
        .filter_map(|(view, path)| compare(view.clone(), &path, survey))
        .collect();
    let Some(best) = compared
        .iter()
        .max_by(|a, b| a.shift.clearness.total_cmp(&b.shift.clearness))
    else {
        let text = "too few points or no readable photo to compare";
        return Ok((finding(Verdict::Note, text.into()), None));
    };
    let (verdict, text) = judge(&compared, best);
    Ok((finding(verdict, text.into()), picture(epoch, best)))
}

/// The photos that see most of the cloud, with a size that fits their cameras.
fn candidates<'a>(photos: &[PosedPhoto<'a>], survey: &Sample) -> Vec<PosedPhoto<'a>> {
    let step = (survey.points.len() / CHOOSERS).max(1);
    let some: Vec<&Point3<f64>> = survey.points.iter().step_by(step).collect();
    let sees = |view: &View| {
        let inside = |p: &&&Point3<f64>| view.project(p).is_some_and(|seen| view.is_inside(seen.pixel));
        some.iter().filter(inside).count()
    };
    let mut seen: Vec<(usize, &PosedPhoto)> = photos
        .iter()
        .map(|photo| (sees(photo.0), photo))
        .filter(|(n, _)| *n > 0)
        .collect();
    seen.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.0.name.cmp(&b.1.0.name)));
    let fits = |(view, path): &PosedPhoto| {
        image_size(path).is_ok_and(|size| size == (view.camera.width, view.camera.height))
    };
    // A photo that cannot be read is named elsewhere; others that see the cloud remain.
    let any_fits = seen.iter().any(|(_, photo)| fits(photo));
    seen.retain(|(_, photo)| !any_fits || fits(photo));
    let best = seen.into_iter().take(PHOTOS);
    best.map(|(_, photo)| photo.clone()).collect()
}

fn compare(view: View, path: &Path, survey: &Sample) -> Option<Compared> {
    let photo = read_rgb(path).ok()?;
    let overlay = Overlay::new(&survey.points, &view, &photo)?;
    let middle = survey.points.get(survey.points.len() / 2)?;
    let depth_m = view.project(middle).map_or(f64::NAN, |seen| seen.depth_m);
    let (shift, pixel_m) = (overlay.shift(), view.gsd_m(depth_m) * overlay.reduction);
    let [right, down] = shift.map_px.map(|pixels| pixels * pixel_m);
    let to_world = view.cam_from_world.rotation.inverse();
    let across = Across {
        shift_m: to_world * Vector3::new(right, down, 0.0),
        sight: to_world * Vector3::z(),
    };
    Some(Compared {
        shift,
        pixel_m,
        across,
        name: view.name,
        overlay,
    })
}

/// What the shifts of an epoch's photos mean.
fn judge(compared: &[Compared], best: &Compared) -> (Verdict, String) {
    let clear: Vec<&Compared> = compared.iter().filter(|c| c.shift.is_clear()).collect();
    if clear.is_empty() {
        let text = format!(
            "the edges of the cloud are not found in the photos ({} tried; a clear fit stands out 5 times, here {:.1}): either the wall has \
             little relief, or cameras and clouds are of different surveys; look at the picture",
            compared.len(),
            best.shift.clearness
        );
        return (Verdict::Note, text);
    }

    let shift = |c: &Compared| c.shift.length();
    let is_off = |c: &Compared, limit: f64| shift(c) > limit && shift(c) * c.pixel_m > HARMLESS_M;
    let of = |limit: f64| clear.iter().filter(|c| is_off(c, limit)).count();
    let px = best.shift.length() * best.overlay.reduction;
    let mm = 1e3 * best.shift.length() * best.pixel_m;
    let place = format!("{px:.0} px ({mm:.0} mm) off those of photo {}", best.name);

    if 2 * of(DOUBTFUL_PX) <= clear.len() {
        let text = format!("the cloud's edges fit best {place}, which light and shade can do");
        return (Verdict::Fine, text);
    }

    // In sound surveys of small walls, single photos were seen with clear shifts of metres.
    let off = compared
        .iter()
        .filter(|c| is_off(c, DOUBTFUL_PX) && c.name != best.name);
    let others: Vec<Across> = off.map(|c| c.across).collect();

    if is_repeated(best.across, &others) {
        let advice = "and another photo shows the same shift: cameras and clouds are not in one frame, or of different surveys; look at \
                      the picture";
        return (Verdict::Doubt, format!("the cloud's edges lie {place}, {advice}"));
    }

    let advice = "and no other photo shows the same shift: this may be chance; look at the picture";
    (Verdict::Note, format!("the cloud's edges lie {place}, {advice}"))
}

/// Whether another photo shows the same shift, once both look the same way.
fn is_repeated(of: Across, others: &[Across]) -> bool {
    let is_same = |other: &Across| {
        let turn = Rotation3::rotation_between(&other.sight, &of.sight);
        let differs = |turn: Rotation3<f64>| (turn * other.shift_m - of.shift_m).norm();
        turn.is_some_and(|turn| differs(turn) < SAME_SHIFT * of.shift_m.norm())
    };
    others.iter().any(is_same)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_that_two_photos_show_is_told_from_chance() {
        // A cloud 35 cm off along y, as cameras see it that look along x, turned to the left or right.
        let seen = |shift: Vector3<f64>, degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let sight = Vector3::new(cos, sin, 0.0);
            Across {
                shift_m: shift - sight * sight.dot(&shift),
                sight,
            }
        };
        let along = Vector3::new(0.0, 0.35, 0.0);
        let best = seen(along, 15.0);
        assert!(!is_repeated(best, &[]));
        assert!(is_repeated(best, &[seen(along, -15.0)]));
        let others = [
            seen(-along, -15.0),
            seen(Vector3::new(0.0, 0.2, 0.0), 5.0),
            seen(Vector3::new(0.0, 0.35, 0.2), 0.0),
        ];
        assert!(!is_repeated(best, &others));
    }
}
