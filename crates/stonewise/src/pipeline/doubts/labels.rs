//! Doubts about where the stones are.

use crate::pipeline::context::Context;
use crate::pipeline::steps::offsets::{LabelOffset, LabelOffsets};
use crate::texts::{BESIDE, BESIDE_COMPARED, Message, TORN};
use stonewise_core::epoch::EpochId;
use stonewise_core::statistics::upper_median;
use stonewise_core::stone::Stone;

/// Labels that lie further than this beside the stones belong to other surfaces in the two epochs, metres: a
/// tenth of a small stone.
const OFFSET_M: f64 = 0.03;
/// Labels lie beside the stones where the surface at their own place is less alike than this share of the
/// best place's.
const UNLIKE: f64 = 0.6;
/// The best place is no chance from this correlation on: that of wrong places reaches 0.17, that of the same
/// surface is about 0.9.
const LIKE: f64 = 0.3;

/// Median over the stones of their share of the photos' votes on their points, below which the photos
/// disagree on where the stones are. Cameras in one frame with the cloud gave 0.94 to 0.99 (simulated) and
/// 0.87 (the real photos of `fountain`); a focal length wrong by a tenth gave 0.6, swapped axes gave 0.7.
const AGREED: f64 = 0.8;
/// Least number of stones whose median is not left to chance.
const LEAST_STONES: usize = 8;

/// Labels beside the stones: cameras and clouds do not fit each other.
pub(super) fn beside(context: &Context, later: EpochId, offsets: &LabelOffsets) -> Vec<(String, String)> {
    let [first, second] = context.project.epochs.pair(later).map(|e| &e.name).into_array();
    // The first epoch takes part in every pair.
    let of_first = offsets.first.filter(|_| later == EpochId::at(1));
    let within = [(first, &of_first), (second, &offsets.second)]
        .into_iter()
        .filter_map(|(name, offset)| Some((name.clone(), off_place(&BESIDE, offset.as_ref()?, first)?)));
    let within: Vec<(String, String)> = within.collect();
    let between = || {
        let offset = offsets.between.as_ref()?;
        Some((second.clone(), off_place(&BESIDE_COMPARED, offset, first)?))
    };
    match within.is_empty() {
        true => between().into_iter().collect(),
        false => within,
    }
}

/// An offset in words, if it is clear and large.
fn off_place(doubt: &Message, offset: &LabelOffset, first: &str) -> Option<String> {
    let is_clear = offset.likeness >= LIKE && offset.likeness_unmoved < UNLIKE * offset.likeness;
    let is_off = is_clear && offset.length_m() > OFFSET_M;
    let [along, up] = offset.along_up_m.map(|m| format!("{:+.0}", 1e3 * m));
    let length = format!("{:.0}", 1e3 * offset.length_m());
    let first = format!("{first:?}");
    let values = [
        ("length", &*length),
        ("along", &*along),
        ("up", &*up),
        ("first", &*first),
    ];
    is_off.then(|| doubt.say(&values))
}

/// The photos of an epoch disagree on where its stones are.
pub(super) fn torn(stones: &[Stone]) -> Option<String> {
    // A single photo agrees with itself.
    let seen_twice = stones.iter().filter(|s| s.photos >= 2);
    let mut shares: Vec<f64> = seen_twice.map(|s| s.confidence).collect();
    let median = upper_median(&mut shares)?;
    (shares.len() >= LEAST_STONES && median < AGREED).then(|| {
        let share = format!("{:.0}", 100.0 * median);
        TORN.say(&[("share", &*share)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use stonewise_core::id::StoneId;

    fn stones(count: u32, photos: u32, confidence: impl Fn(u32) -> f64) -> Vec<Stone> {
        let stone = |i| Stone {
            id: StoneId(i + 1),
            centroid: Point3::origin(),
            normal: Vector3::x(),
            area_m2: 0.1,
            points: 100,
            photos,
            confidence: confidence(i),
        };
        (0..count).map(stone).collect()
    }

    #[test]
    fn photos_that_do_not_agree_about_most_stones_are_a_doubt() {
        let message = torn(&stones(21, 3, |i| 0.5 + 0.01 * f64::from(i))).unwrap();
        assert!(message.contains("only 60 %"), "{message}");
        // A few bad stones on a sound wall, a wall of one photo each, and too few stones to tell.
        assert_eq!(torn(&stones(21, 3, |i| if i < 9 { 0.3 } else { 0.9 })), None);
        assert_eq!(torn(&stones(21, 1, |_| 0.5)), None);
        assert_eq!(torn(&stones(7, 3, |_| 0.5)), None);
        assert_eq!(torn(&[]), None);
    }
}
