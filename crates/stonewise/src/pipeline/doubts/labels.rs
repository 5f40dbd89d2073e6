//! Doubts about where the stones are.

use super::check::Check;
use super::fit::Fit;
use super::rules::{AGREED, IN_PLACE};
use crate::pipeline::context::Context;
use crate::pipeline::steps::offsets::{LabelOffset, LabelOffsets};
use crate::texts::notices::{STONES_MISSED, STONES_MISSED_BY_VOTES};
use crate::texts::{COMPARED, Said};
use stonewise_core::epoch::EpochId;
use stonewise_core::statistics::upper_median;
use stonewise_core::stone::Stone;

/// Labels lie beside the stones where the surface at their own place is less alike than this share of the
/// best place's.
const UNLIKE: f64 = 0.6;
/// The best place is no chance from this correlation on: that of wrong places reaches 0.17, that of the same
/// surface is about 0.9.
const LIKE: f64 = 0.3;

/// Least number of stones whose median is not left to chance.
const LEAST_STONES: usize = 8;

/// Labels beside the stones: cameras and clouds do not fit each other.
pub(super) fn beside(context: &Context, later: EpochId, offsets: &LabelOffsets) -> Vec<(String, Check)> {
    let epochs = context.project.epochs.pair(later);
    let [first, second] = epochs.map(|e| &e.name).into_array();
    // Views fit the clouds that they were made of.
    let [of_photos, of_later_photos] = epochs.map(|e| e.photos.is_some()).into_array();
    // The first epoch takes part in every pair.
    let of_first = offsets.first.filter(|_| of_photos && later == EpochId::at(1));
    let of_second = offsets.second.filter(|_| of_later_photos);
    let mut checks: Vec<(String, Check)> = [(first, of_first), (second, of_second)]
        .into_iter()
        .filter_map(|(name, offset)| Some((name.clone(), in_place(&offset?, "".into())?)))
        .collect();
    let between = offsets.between.filter(|_| of_photos && of_later_photos);
    let compared = COMPARED.say(&[("first", format!("{first:?}").into())]);
    let between = between.and_then(|offset| in_place(&offset, compared));
    // Where the labels of both epochs lie on their own clouds, those of the later one may still lie on other stones.
    if let Some(between) = between.filter(|check| check.doubt.is_some())
        && checks.iter().all(|(_, check)| check.doubt.is_none())
    {
        checks.retain(|(name, _)| name != second);
        checks.push((second.clone(), between));
    }
    checks
}

/// The check of an offset, if it is clear; `compared`: with what.
fn in_place(offset: &LabelOffset, compared: Said) -> Option<Check> {
    let is_beside = offset.likeness_unmoved < UNLIKE * offset.likeness;
    let length_m = if is_beside { offset.length_m() } else { 0.0 };
    let values = || {
        let [along, up] = offset.along_up_m.map(|m| format!("{:+.0}", 1e3 * m));
        [
            ("length", format!("{:.0}", 1e3 * length_m).into()),
            ("along", along.into()),
            ("up", up.into()),
            ("compared", compared),
        ]
    };
    (offset.likeness >= LIKE).then(|| IN_PLACE.check(length_m, values))
}

/// The photos' votes on the stones of an epoch.
///
/// Two causes lower a stone's share. A photo in which the detector misses the stone votes against it: the share
/// then grows with the number of photos that show it, and is high where that is largest. Photos that do not fit
/// the cloud vote for other places: then it stays low, however many photos there are, and they do not find the
/// stones again.
#[derive(Clone, Copy, Debug)]
pub(super) struct Votes {
    /// Share of a typical stone.
    share: f64,
    /// Share of those stones that the most photos show.
    best: f64,
}

impl Votes {
    /// `None` where too few stones are shown by two photos or more: a single photo agrees with itself.
    pub fn of(stones: &[Stone]) -> Option<Self> {
        let mut seen: Vec<&Stone> = stones.iter().filter(|s| s.photos >= 2).collect();
        seen.sort_by_key(|s| std::cmp::Reverse(s.photos));
        let median =
            |stones: &[&Stone]| upper_median(&mut stones.iter().map(|s| s.confidence).collect::<Vec<_>>());
        let fewest = seen.get(seen.len() / 4)?.photos;
        let most = seen.partition_point(|s| s.photos >= fewest);
        let votes = Self {
            share: median(&seen)?,
            best: median(&seen[..most])?,
        };
        (seen.len() >= LEAST_STONES).then_some(votes)
    }

    /// Whether the votes suggest photos that do not fit the cloud; `None` where they are few, but the photos find the
    /// stones, so that they do fit. Where that is not known, the stones that most photos show decide.
    pub fn check(self, fit: Fit) -> Option<Check> {
        let share = match fit.holds() {
            Some(true) if self.are_few() => return None,
            Some(_) => self.share,
            None => self.share.max(self.best),
        };
        let values = || {
            let [share, best] = self.percent();
            [("share", share), ("best", best), ("cause", fit.cause())]
        };
        Some(AGREED.check(share, values))
    }

    /// Whether a typical stone gets fewer than it should.
    fn are_few(self) -> bool {
        !AGREED.passes(self.share)
    }

    /// What is said of few votes of photos that fit the cloud.
    pub fn missed(self, fit: Fit) -> Option<Said> {
        let [share, best] = self.percent();
        let votes = [("share", share), ("best", best)];
        let said = match fit.holds() {
            Some(_) => STONES_MISSED.say(&[votes, fit.values()].concat()),
            None => STONES_MISSED_BY_VOTES.say(&votes),
        };
        let fits = self.check(fit).is_none_or(|check| check.doubt.is_none());
        (self.are_few() && fits).then_some(said)
    }

    fn percent(self) -> [Said; 2] {
        [self.share, self.best].map(|share| format!("{:.0}", 100.0 * share).into())
    }
}

#[cfg(test)]
mod tests {
    use super::super::check::said;
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

    const FOUND: Fit = Fit::of_counts(90, 100);
    const NOT_FOUND: Fit = Fit::of_counts(10, 100);
    const UNKNOWN: Fit = Fit::of_counts(0, 0);

    #[test]
    fn photos_that_do_not_fit_the_cloud_are_a_doubt_and_missed_stones_are_none() {
        let votes = |stones: &[Stone]| Votes::of(stones).unwrap();
        // As few votes however many photos there are.
        let low = votes(&stones(21, 3, |i| 0.5 + 0.01 * f64::from(i)));
        assert!(said(low.check(UNKNOWN)).is_some());
        let message = said(low.check(NOT_FOUND)).unwrap();
        assert!(
            message.english.contains("only 60 %") && message.english.contains("10 of the 100 stones"),
            "{message}"
        );
        // The photos find the stones all the same.
        assert!(low.are_few() && said(low.check(FOUND)).is_none());
        assert!(low.missed(FOUND).is_some() && low.missed(NOT_FOUND).is_none());
        // A detector that finds a stone in n of eight photos: n eighths of the votes.
        let mut missed = Vec::new();
        for photos in 2..=8 {
            missed.extend(stones(9, photos, |_| f64::from(photos) / 8.0));
        }
        assert!(votes(&missed).are_few() && said(votes(&missed).check(UNKNOWN)).is_none());
        let message = votes(&missed).missed(FOUND).unwrap();
        assert!(
            message.english.contains("62 %") && message.english.contains("100 %"),
            "{message}"
        );
        let message = votes(&missed).missed(UNKNOWN).unwrap();
        assert!(!message.english.contains("photos find"), "{message}");
        // A few bad stones on a sound wall, a wall of one photo each, and too few stones to tell.
        assert!(!votes(&stones(21, 3, |i| if i < 9 { 0.3 } else { 0.9 })).are_few());
        assert!(Votes::of(&stones(21, 1, |_| 0.5)).is_none());
        assert!(Votes::of(&stones(7, 3, |_| 0.5)).is_none());
        assert!(Votes::of(&[]).is_none());
    }
}
