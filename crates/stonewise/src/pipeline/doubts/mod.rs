//! Doubts about the results of a pair of epochs as a whole.

use crate::pipeline::context::Context;
use crate::pipeline::steps::label::Labelled;
use crate::pipeline::steps::offsets::{LabelOffset, LabelOffsets};
use crate::pipeline::steps::register::Registered;
use crate::results::records::EstimatorRecord;
use crate::results::{Status, StoneRow};
use crate::texts::{
    BESIDE, BESIDE_COMPARED, BLIND, FEW_MEASURED, MISREGISTERED_EPOCH, Message, NOT_CONVERGED, TORN,
};
use nalgebra::Vector3;
use stonewise_core::registration::observers::CrossCheck;
use stonewise_core::statistics::upper_median;
use stonewise_core::stone::{Stone, StoneMotion};

/// Median 95 % limit of detection, in units of what spacing and noise of the points allow, beyond which
/// something other than noise hides the motions.
const LIMIT_EXCESS: f64 = 100.0;
/// Half width of a 95 % interval, in standard deviations.
const SIGMAS_95: f64 = 1.96;

/// Labels that lie further than this beside the stones belong to other surfaces in the two epochs, metres: a
/// tenth of a small stone.
const OFFSET_M: f64 = 0.03;
/// Labels lie beside the stones where the surface at their own place is less alike than this share of the
/// best place's.
const UNLIKE: f64 = 0.6;
/// The best place is no chance from this correlation on: that of wrong places reaches 0.17, that of the same
/// surface is about 0.9.
const LIKE: f64 = 0.3;

/// Probability of the difference between the registration errors with and without surfaces off the wall,
/// below which the run is in doubt: one sound survey in a thousand.
const MISREGISTERED: f64 = 1e-3;

/// Median over the stones of their share of the photos' votes on their points, below which the photos
/// disagree on where the stones are. Cameras in one frame with the cloud gave 0.94 to 0.99 (simulated) and
/// 0.87 (the real photos of `fountain`); a focal length wrong by a tenth gave 0.6, swapped axes gave 0.7.
const AGREED: f64 = 0.8;
/// Least number of stones whose median is not left to chance.
const LEAST_STONES: usize = 8;

/// Warns where the motions of a pair of epochs cannot be relied on.
pub fn note_doubts(
    context: &Context,
    number: usize,
    labelled: [&Labelled; 2],
    offsets: &LabelOffsets,
    registered: &Registered,
    rows: &[StoneRow],
) {
    let epoch = &context.project.epochs[number - 1].name;
    // The first epoch takes part in every pair.
    let first_time = usize::from(number > 2);
    for (which, labels) in [0, number - 1].into_iter().zip(labelled).skip(first_time) {
        if let Some(message) = torn(&labels.stones) {
            let name = &context.project.epochs[which].name;
            context.warnings.doubt("label", name, message);
        }
    }
    for (name, message) in beside(context, number, offsets) {
        context.warnings.doubt("label", name, message);
    }
    let cross_check = registered
        .epoch_errors
        .as_ref()
        .and_then(|e| e.cross_check.as_ref());
    let stated_m = context.project.settings.registration.epoch_error_m;
    let found = [
        unsettled(registered),
        cross_check.and_then(|check| misregistered(stated_m, check)),
        few_measured(rows),
        blind(registered, rows),
    ];
    for message in found.into_iter().flatten() {
        context.warnings.doubt("register", epoch, message);
    }
}

/// Labels beside the stones: cameras and clouds do not fit each other.
fn beside(context: &Context, number: usize, offsets: &LabelOffsets) -> Vec<(String, String)> {
    let [first, second] = [0, number - 1].map(|e| &context.project.epochs[e].name);
    // The first epoch takes part in every pair.
    let of_first = offsets.first.filter(|_| number == 2);
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
fn torn(stones: &[Stone]) -> Option<String> {
    // A single photo agrees with itself.
    let seen_twice = stones.iter().filter(|s| s.photos >= 2);
    let mut shares: Vec<f64> = seen_twice.map(|s| s.confidence).collect();
    let median = upper_median(&mut shares)?;
    (shares.len() >= LEAST_STONES && median < AGREED).then(|| {
        let share = format!("{:.0}", 100.0 * median);
        TORN.say(&[("share", &*share)])
    })
}

/// The adjustment stopped before its motions had settled.
fn unsettled(registered: &Registered) -> Option<String> {
    let EstimatorRecord::Adjustment(adjustment) = &registered.estimator else {
        return None;
    };
    let iterations = adjustment.iterations.to_string();
    (!adjustment.converged).then(|| NOT_CONVERGED.say(&[("iterations", &*iterations)]))
}

/// Surfaces off the wall show a registration error that differs significantly from the one found without
/// them. An error that the project states is not questioned.
fn misregistered(stated_m: Option<f64>, check: &CrossCheck) -> Option<String> {
    if stated_m.is_some() || check.p >= MISREGISTERED {
        return None;
    }
    let mm = |v: &Vector3<f64>| format!("({:+.1}, {:+.1}, {:+.1})", 1e3 * v.x, 1e3 * v.y, 1e3 * v.z);
    let sd = check.covariance.diagonal().max().max(0.0).sqrt();
    let values = [
        ("cells", &*check.cells.to_string()),
        ("shown", &*mm(&check.error)),
        ("found", &*mm(&check.found)),
        ("sd", &*format!("{:.1}", 1e3 * sd)),
    ];
    Some(MISREGISTERED_EPOCH.say(&values))
}

/// Most of the stones that were found in both epochs could not be measured.
fn few_measured(rows: &[StoneRow]) -> Option<String> {
    let matched = rows.iter().filter(|r| r.matched_id.is_some()).count();
    let measured = rows.iter().filter(|r| r.status == Status::Ok).count();
    (2 * measured < matched).then(|| {
        let counts = Status::ALL.iter().filter_map(|status| {
            let n = rows
                .iter()
                .filter(|r| r.status == *status && r.matched_id.is_some() && *status != Status::Ok)
                .count();
            (n > 0).then(|| format!("{n} {}", status.word()))
        });
        let values = [
            ("measured", &*measured.to_string()),
            ("matched", &*matched.to_string()),
            ("reasons", &*counts.collect::<Vec<_>>().join(", ")),
        ];
        FEW_MEASURED.say(&values)
    })
}

/// Motions are far less certain than the points allow.
fn blind(registered: &Registered, rows: &[StoneRow]) -> Option<String> {
    let points: std::collections::BTreeMap<u32, [f64; 2]> = rows
        .iter()
        .filter_map(|r| Some((r.stone_id, [f64::from(r.points_1), f64::from(r.points_2?)])))
        .collect();
    let ratio = |(stone, motion): (u32, &StoneMotion)| {
        let [one, two] = points.get(&stone)?.map(|n| n.max(1.0));
        let allowed = motion.rmse_m * (1.0 / one + 1.0 / two).sqrt();
        let covariance = motion.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let sd = covariance.symmetric_eigenvalues().max().max(0.0).sqrt();
        (allowed > 0.0).then_some((sd / allowed, sd))
    };
    let measured = registered.results.iter();
    let measured = measured.filter_map(|r| Some((r.first.0, r.motion.as_ref().ok()?)));
    let mut all: Vec<(f64, f64)> = measured.filter_map(ratio).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let &(excess, sd) = all.get(all.len() / 2)?;
    (excess > LIMIT_EXCESS).then(|| {
        let limit = format!("{:.0}", 1e3 * SIGMAS_95 * sd);
        let values = [("limit", &*limit), ("excess", &*format!("{excess:.0}"))];
        BLIND.say(&values)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
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

    #[test]
    fn what_surfaces_off_the_wall_show_is_doubted_only_against_an_assumption() {
        let with = |p| CrossCheck {
            cells: 30,
            error: Vector3::new(0.02, 0.0, -0.001),
            found: Vector3::zeros(),
            covariance: nalgebra::Matrix3::identity() * 25e-8,
            p,
        };
        assert_eq!(misregistered(None, &with(0.01)), None);
        assert_eq!(misregistered(Some(0.02), &with(1e-9)), None);
        let message = misregistered(None, &with(1e-9)).unwrap();
        for part in ["30 pieces", "(+20.0, +0.0, -1.0) mm", "of 0.5 mm"] {
            assert!(message.contains(part), "{message}");
        }
    }
}
