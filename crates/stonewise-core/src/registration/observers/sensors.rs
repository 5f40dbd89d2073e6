//! The sources of the sharpest sensor of each epoch, which give the most precise datum.

use super::epoch_pair::EpochPair;
use super::sight::{SeenStone, Source};
use super::stable::StablePoints;
use crate::geometry::FaceFrame;
use crate::registration::points::{noise_of, sharpest_sensor};
use crate::statistics::upper_median;

/// Stones on which a source's noise is measured.
const STONES: usize = 40;

/// What the sources of the sharpest sensors show of two epochs.
pub(super) struct Sharpest {
    pub sources: Vec<Source>,
    pub stones: Vec<SeenStone>,
    pub stable: Vec<StablePoints>,
    pub offered: Vec<StablePoints>,
}

impl Sharpest {
    /// `None` where each epoch has one sensor.
    pub fn of(pair: &EpochPair) -> Option<Self> {
        let kept = kept(pair);
        if kept.iter().all(|k| *k) {
            return None;
        }
        let mut new = vec![None; kept.len()];
        for (k, source) in (0..kept.len()).filter(|k| kept[*k]).enumerate() {
            new[source] = Some(k);
        }
        let own = pair.sources.iter().zip(&kept).filter(|(_, kept)| **kept);
        let sources = own.map(|(source, _)| Source {
            same_as: source.same_as.and_then(|s| new[s]),
            ..source.clone()
        });

        let stone = |stone: &SeenStone| {
            let sights = stone.sights.iter().filter_map(|s| {
                let source = new[s.source]?;
                let mut sight = s.clone();
                sight.source = source;
                Some(sight)
            });
            SeenStone {
                sights: sights.collect(),
                ..stone.clone()
            }
        };

        let areas = |list: &[StablePoints]| {
            let own = list.iter().filter_map(|p| {
                let source = new[p.source]?;
                let mut points = p.clone();
                points.source = source;
                Some(points)
            });
            own.collect()
        };

        Some(Self {
            sources: sources.collect(),
            stones: pair.stones.iter().map(stone).collect(),
            stable: areas(pair.stable),
            offered: areas(pair.offered),
        })
    }

    /// The pair of epochs with these alone.
    pub fn pair<'a>(&'a self, of: &EpochPair<'a>) -> EpochPair<'a> {
        EpochPair {
            sources: &self.sources,
            stones: &self.stones,
            stable: &self.stable,
            offered: &self.offered,
            neighbours: of.neighbours,
            sigma_m: of.sigma_m,
            response: of.response,
            is_aligned: of.is_aligned,
            network: of.network,
            has_unknown_photos: of.has_unknown_photos,
            scale: of.scale,
        }
    }
}

/// Which sources are of the sharpest sensor of their epoch that shows enough of its stones.
fn kept(pair: &EpochPair) -> Vec<bool> {
    let mut kept = vec![true; pair.sources.len()];
    for epoch in 0..2 {
        let shows = |sources: &[usize]| {
            let is_shown = |stone: &&SeenStone| stone.sights.iter().any(|s| sources.contains(&s.source));
            pair.stones.iter().filter(is_shown).count() as f64
        };
        let all: Vec<usize> = (0..kept.len())
            .filter(|s| pair.sources[*s].epoch == epoch)
            .collect();
        if all.len() < 2 {
            continue;
        }
        let noises = all.iter().filter_map(|s| Some((*s, noise_m(pair, *s)?)));
        if let Some(sensor) = sharpest_sensor(noises.collect(), shows(&all), shows) {
            all.iter().for_each(|s| kept[*s] = sensor.contains(s));
        }
    }
    kept
}

/// Noise of a source's points along the normal, in the median of the stones; `None` where none is compared.
fn noise_m(pair: &EpochPair, source: usize) -> Option<f64> {
    let on_stone = |stone: &SeenStone| {
        let face_from_world = FaceFrame::from_normal(&stone.normal).face_from_world();
        let own = stone.sights.iter().find(|s| s.source == source)?;
        noise_of(&own.points, &face_from_world)
    };
    let mut noises: Vec<f64> = pair.stones.iter().filter_map(on_stone).take(STONES).collect();
    upper_median(&mut noises)
}
