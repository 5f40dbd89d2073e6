//! Surveys whose files lack sources or times, to measure what these contribute.

use super::small_wall::Survey;
use stonewise_core::cloud::Cloud;
use stonewise_core::registration::observers::{SeenStone, Source, SourcePoints};

/// What the files keep.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// The times of the points.
    pub times: bool,
    /// Which station or strip a point comes from.
    pub sources: bool,
}

impl Kept {
    pub fn apply(self, mut survey: Survey) -> Survey {
        if !self.times {
            survey.sources.iter_mut().for_each(|s| s.has_times = false);
        }
        match self.sources {
            true => survey,
            false => merged(survey),
        }
    }
}

/// The survey with one source for each epoch.
fn merged(mut survey: Survey) -> Survey {
    let epochs: Vec<usize> = survey.sources.iter().map(|s| s.epoch).collect();
    for stone in &mut survey.stones {
        stone.sights = [0, 1]
            .into_iter()
            .filter_map(|e| sight_of_epoch(stone, e, &epochs))
            .collect();
    }
    survey.stable.iter_mut().for_each(|s| s.source = epochs[s.source]);
    survey.sources = [0, 1]
        .map(|epoch| Source {
            name: format!("{epoch}"),
            epoch,
            has_times: false,
            same_as: None,
        })
        .into();
    survey
}

/// All points of an epoch on a stone; `None` where there are none.
fn sight_of_epoch(stone: &SeenStone, epoch: usize, epochs: &[usize]) -> Option<SourcePoints> {
    let own: Vec<&SourcePoints> = stone
        .sights
        .iter()
        .filter(|s| epochs[s.source] == epoch)
        .collect();
    let places = own
        .iter()
        .flat_map(|s| (0..s.points.len()).map(|i| s.points.world(i)));
    (!own.is_empty()).then(|| SourcePoints {
        source: epoch,
        count: own.iter().map(|s| s.count).sum(),
        time_s: own[0].time_s,
        points: Cloud::from_world(stone.centroid, places.collect::<Vec<_>>()),
    })
}
