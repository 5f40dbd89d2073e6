//! What each station and strip shows of the matched stones and of the stable areas, gathered in one pass over
//! the tiles.

use super::datum::is_one_survey;
use super::off_wall::OffWall;
use crate::error::Result;
use crate::pipeline::steps::label::Labelled;
use crate::project::Project;
use crate::sources::EpochSources;
use crate::stable::StableArea;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use stonewise_core::cloud::{Cloud, TileSource};
use stonewise_core::epoch::{EpochId, Pair};
use stonewise_core::geometry::{Bounds, cell_of};
use stonewise_core::id::StoneId;
use stonewise_core::progress::Progress;
use stonewise_core::registration::observers::{SeenStone, Source, SourcePoints, StablePoints};
use stonewise_core::stone::Stone;

/// Edge of the cells in which the points of a stable area are counted, metres, and the most that one source
/// keeps in a cell.
const STABLE_CELL_M: f64 = 0.1;
const STABLE_POINTS: u32 = 40;

/// The sources of two epochs and what they show.
pub struct Sights {
    /// Sources of the reference epoch, then those of the later one.
    pub sources: Vec<Source>,
    /// Number of sources of an epoch that count as one, because they are too many.
    pub too_many: [Option<usize>; 2],
    /// Stones of the reference epoch, in the order of `seen`.
    pub stones: Vec<StoneId>,
    /// What the sources show of them.
    pub seen: Vec<SeenStone>,
    /// Points in stable areas.
    pub stable: Vec<StablePoints>,
    /// Points in areas off the wall that do not count as stable.
    pub offered: Vec<StablePoints>,
}

/// Largest number of areas off the wall that are compared with the sources' errors. Their plane cells
/// determine an error far more accurately than the sources do.
const MOST_OFFERED: usize = 40;

impl Sights {
    /// `off_wall`: areas off the wall, which count as stable if the
    /// project sets `auto_stable`. The project's parameters set how many stones keep their points; they are
    /// evenly chosen among the matches.
    pub fn gather(
        project: &Project,
        epochs: Pair<EpochId>,
        labelled: Pair<&Labelled>,
        matches: &[(StoneId, StoneId)],
        off_wall: &OffWall,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut of_epoch = Vec::new();
        for (labelled, epoch) in labelled.zip(epochs.map(|e| &project.epochs[e])) {
            let raw = labelled.ingested.tiles.surveyed.raw_sources()?;
            of_epoch.push(EpochSources::new(&raw, &epoch.clouds));
        }

        let mut sources: Vec<Source> = of_epoch
            .iter()
            .enumerate()
            .flat_map(|(epoch, list)| {
                list.list.iter().map(move |s| Source {
                    name: s.name.clone(),
                    epoch,
                    has_times: s.has_times,
                    same_as: None,
                })
            })
            .collect();
        if is_one_survey(project, epochs) {
            share_errors(&mut sources);
        }

        let places = matched_stones(&labelled.first.stones, matches);
        let mut sights = Self {
            too_many: [0, 1].map(|e| of_epoch[e].too_many),
            stones: places.iter().map(|(first, _, _)| *first).collect(),
            seen: Vec::new(),
            stable: Vec::new(),
            offered: Vec::new(),
            sources,
        };
        let auto_stable = project.settings.registration.auto_stable;
        let offered = match auto_stable {
            true => OffWall::default(),
            false => off_wall.thinned(MOST_OFFERED),
        };

        let most_stones = project.settings.registration.observers.contrasts.max_stones;
        let stride = places.len().div_ceil(most_stones.max(1)).max(1);
        let mut collected: Vec<BTreeMap<usize, Collected>> = vec![BTreeMap::new(); places.len()];

        for (e, epoch) in labelled.into_iter().enumerate() {
            let ids = places
                .iter()
                .enumerate()
                .map(|(k, (first, second, _))| ([first, second][e].0, k));
            let pass = Pass {
                epoch,
                sources: &of_epoch[e],
                first_source: e * of_epoch[0].list.len(),
                stones: ids.collect(),
                areas: &project.settings.registration.stable,
            };
            pass.stones(&places, stride, &mut collected, progress)?;
            pass.stable(&mut sights.stable)?;
            if auto_stable {
                pass.off_wall(off_wall, &mut sights.stable)?;
            }
            pass.off_wall(&offered, &mut sights.offered)?;
        }

        sights.seen = places
            .iter()
            .zip(collected)
            .map(|((_, _, stone), parts)| SeenStone {
                centroid: stone.centroid,
                normal: stone.normal,
                sights: parts
                    .into_iter()
                    .map(|(s, c)| c.finish(s, &stone.centroid))
                    .collect(),
            })
            .collect();
        Ok(sights)
    }
}

/// Matched pairs with their stone in the reference epoch.
fn matched_stones<'a>(
    stones: &'a [Stone],
    matches: &[(StoneId, StoneId)],
) -> Vec<(StoneId, StoneId, &'a Stone)> {
    let by_id: BTreeMap<StoneId, &Stone> = stones.iter().map(|s| (s.id, s)).collect();
    let found = matches
        .iter()
        .filter_map(|(first, second)| Some((*first, *second, *by_id.get(first)?)));
    found.collect()
}

/// Gives sources of the later epoch the error of those of the same name in the reference: both epochs are parts
/// of one survey.
fn share_errors(sources: &mut [Source]) {
    let (first, second) = sources.split_at_mut(sources.partition_point(|s| s.epoch == 0));
    for source in second {
        source.same_as = first.iter().position(|s| s.name == source.name);
    }
}

/// Points of one source on one stone, as far as they are gathered.
#[derive(Clone, Default)]
struct Collected {
    count: u64,
    time_sum_s: f64,
    offsets: Vec<[f32; 3]>,
}

impl Collected {
    fn finish(self, source: usize, centroid: &Point3<f64>) -> SourcePoints {
        SourcePoints {
            source,
            count: self.count,
            time_s: self.time_sum_s / self.count.max(1) as f64,
            points: Cloud::new(*centroid, self.offsets),
        }
    }
}

/// Places, and seconds since the source began.
type PlacesAndTimes = (Vec<Point3<f64>>, Vec<f64>);

/// Points of stable areas, by area and source, as far as they are gathered.
#[derive(Default)]
struct StableParts {
    parts: BTreeMap<(usize, usize), PlacesAndTimes>,
    /// Points by area, source and cell.
    counts: BTreeMap<(usize, usize, [i64; 3]), u32>,
}

impl StableParts {
    fn add(&mut self, area: usize, source: usize, place: Point3<f64>, time_s: f64) {
        let cell = (area, source, cell_of(&place, STABLE_CELL_M));
        let count = self.counts.entry(cell).or_default();
        *count += 1;
        if *count <= STABLE_POINTS {
            let part = self.parts.entry((area, source)).or_default();
            part.0.push(place);
            part.1.push(time_s);
        }
    }

    fn finish(self, list: &mut Vec<StablePoints>) {
        let points = self
            .parts
            .into_iter()
            .filter_map(|((area, source), (points, times_s))| {
                let bounds = Bounds::of(points.iter().copied())?;
                Some(StablePoints {
                    area,
                    source,
                    points: Cloud::from_world(bounds.centre(), points),
                    times_s,
                })
            });
        list.extend(points);
    }
}

/// One epoch's pass over its tiles.
struct Pass<'a> {
    epoch: &'a Labelled,
    sources: &'a EpochSources,
    /// Number of this epoch's first source.
    first_source: usize,
    /// Place in the list of matched stones, by the stone's number in this epoch.
    stones: BTreeMap<u32, usize>,
    areas: &'a [StableArea],
}

impl Pass<'_> {
    fn stones(
        &self,
        places: &[(StoneId, StoneId, &Stone)],
        stride: usize,
        collected: &mut [BTreeMap<usize, Collected>],
        progress: &dyn Progress,
    ) -> Result<()> {
        let tiles = &self.epoch.ingested.tiles;
        let load = |tile| -> Result<_> {
            let labels = self.epoch.labels(tile)?;
            let is_shown = labels.stone.iter().any(|s| self.stones.contains_key(s));
            let points = || Ok((labels, tiles.load(tile)?, tiles.surveyed.origins(tile)?));
            is_shown.then(points).transpose()
        };
        progress.each_prepared("compare sources", 0..tiles.tile_count(), load, |_, loaded| {
            if let Some((labels, cloud, origins)) = loaded {
                for (i, stone) in labels.stone.iter().enumerate() {
                    let Some(&k) = self.stones.get(stone) else {
                        continue;
                    };
                    let (source, time_s) = self.sources.of(origins.source[i], origins.time_s[i]);
                    let part = collected[k].entry(self.first_source + source).or_default();
                    part.count += 1;
                    part.time_sum_s += time_s;
                    if k % stride == 0 {
                        let offset: Vector3<f64> = cloud.world(i) - places[k].2.centroid;
                        part.offsets.push(offset.cast::<f32>().into());
                    }
                }
            }
            Ok(())
        })
    }

    /// Points in the project's stable areas.
    fn stable(&self, list: &mut Vec<StablePoints>) -> Result<()> {
        let tiles = &self.epoch.ingested.tiles;
        for (number, area) in self.areas.iter().enumerate() {
            let Some(bounds) = area.bounds() else { continue };
            let mut parts = StableParts::default();
            for tile in (0..tiles.tile_count()).filter(|&t| tiles.bounds(t).intersects(&bounds)) {
                self.stable_in(
                    tile,
                    |p| Self::is_in(area, &bounds, p).then_some(number),
                    &mut parts,
                )?;
            }
            parts.finish(list);
        }
        Ok(())
    }

    /// Points in areas off the wall, which are numbered after the project's.
    fn off_wall(&self, off_wall: &OffWall, list: &mut Vec<StablePoints>) -> Result<()> {
        let mut parts = StableParts::default();
        let area = |p: &Point3<f64>| Some(self.areas.len() + off_wall.area(p)?);
        let (tiles, bounds) = (&self.epoch.ingested.tiles, off_wall.bounds());
        let has_area = |tile: &usize| bounds.iter().any(|b| tiles.bounds(*tile).intersects(b));
        for tile in (0..tiles.tile_count()).filter(has_area) {
            self.stable_in(tile, area, &mut parts)?;
        }
        parts.finish(list);
        Ok(())
    }

    fn stable_in(
        &self,
        tile: usize,
        area: impl Fn(&Point3<f64>) -> Option<usize>,
        parts: &mut StableParts,
    ) -> Result<()> {
        let tiles = &self.epoch.ingested.tiles;
        let (cloud, origins) = (tiles.load(tile)?, tiles.surveyed.origins(tile)?);
        for i in 0..cloud.len() {
            let place = cloud.world(i);
            let Some(area) = area(&place) else { continue };
            let (source, time_s) = self.sources.of(origins.source[i], origins.time_s[i]);
            parts.add(area, self.first_source + source, place, time_s);
        }
        Ok(())
    }

    fn is_in(area: &StableArea, bounds: &Bounds, place: &Point3<f64>) -> bool {
        bounds.contains(place) && area.contains(place)
    }
}
