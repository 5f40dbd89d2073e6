//! Labels and matches on the sample surveys, where they are at hand.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use nalgebra::Point3;
use stonewise_core::cloud::{Cloud, MemoryTiles, TileSource};
use stonewise_core::evaluate::LabelConfusion;
use stonewise_core::geometry::View;
use stonewise_core::id::{ImageId, StoneId};
use stonewise_core::matching::{
    Footprints, MatchParams, MatchReport, Surroundings, footprint_overlap, match_stones,
};
use stonewise_core::progress::Progress;
use stonewise_core::stone::{MatchOutcome, Stone};
use stonewise_core::transfer::{
    MemoryLabels, StoneParams, Transfer, TransferParams, build_stones, transfer_labels,
};
use stonewise_io::cameras::read_cameras;
use stonewise_io::cloud::{CloudError, read_cloud};
use stonewise_io::masks::{MaskError, MaskSource};
use stonewise_testing::survey;

const TILE_M: f64 = 4.0;

fn data() -> Option<PathBuf> {
    survey("fountain")?;
    survey("dam_small")?.parent().map(Path::to_path_buf)
}

/// A cloud in tiles, with one number a point in the same order.
struct Tiled {
    tiles: MemoryTiles,
    numbers: Vec<Vec<u32>>,
}

fn tiled(points: &[Point3<f64>], numbers: &[u32]) -> Tiled {
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (i, p) in points.iter().enumerate() {
        let key = [0, 1, 2].map(|a| (p[a] / TILE_M).floor() as i64);
        cells.entry(key).or_default().push(i);
    }
    let cloud = |key: &[i64; 3], ids: &[usize]| {
        let origin = Point3::from(key.map(|k| (k as f64 + 0.5) * TILE_M));
        Cloud::from_world(origin, ids.iter().map(|&i| points[i]))
    };
    Tiled {
        tiles: MemoryTiles::new(cells.iter().map(|(key, ids)| cloud(key, ids))),
        numbers: cells
            .values()
            .map(|ids| {
                ids.iter()
                    .map(|&i| numbers.get(i).copied().unwrap_or(0))
                    .collect()
            })
            .collect(),
    }
}

fn positions(path: &Path) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    read_cloud(path, 1_000_000, |chunk| {
        points.extend_from_slice(&chunk.positions);
        Ok::<(), CloudError>(())
    })
    .unwrap();
    points
}

/// Marks points of things that are not the wall: ground, building, railing, shrubs.
const OCCLUDER: u32 = 1 << 31;

/// True stone of every point of a simulated cloud, or [`OCCLUDER`]; the extra dimensions are the stone in 32
/// bits, the material in 8 (0 is masonry) and a flag.
fn true_stones(path: &Path) -> Vec<u32> {
    let data = las::Reader::from_path(path).unwrap().read_all().unwrap();
    let number = |record: &[u8]| {
        let extra = &record[record.len() - 6..];
        let stone = u32::from_le_bytes(extra[..4].try_into().unwrap());
        if extra[4] == 0 { stone } else { OCCLUDER }
    };
    data.raw_bytes()
        .chunks_exact(data.record_len())
        .map(number)
        .collect()
}

/// Prints when each step began.
struct Stopwatch(Instant);

impl Progress for Stopwatch {
    fn begin(&self, what: &str, total: u64) {
        println!("    {:>7.2} s  {what} ({total})", self.0.elapsed().as_secs_f64());
    }
    fn advance(&self, _units: u64) {}
    fn is_cancelled(&self) -> bool {
        false
    }
}

struct Labelled {
    tiled: Tiled,
    labels: MemoryLabels,
    transfer: Transfer,
    stones: Vec<Stone>,
}

fn label(
    tiled: Tiled,
    views: &[View],
    mask: impl FnMut(ImageId) -> Result<Option<stonewise_core::raster::LabelImage>, MaskError>,
) -> Labelled {
    let start = Instant::now();
    let watch = Stopwatch(start);
    let mut labels = MemoryLabels::default();
    let params = TransferParams::default();
    let transfer = transfer_labels(&tiled.tiles, views, mask, &mut labels, &params, &watch).unwrap();
    let voted = start.elapsed();
    let stones = build_stones(
        &tiled.tiles,
        &labels,
        views,
        &transfer.stones,
        &StoneParams::default(),
        &watch,
    )
    .unwrap();
    println!(
        "  {} stones, {} decisions, labels {voted:.1?}, table {:.1?}",
        stones.len(),
        transfer.audit.len(),
        start.elapsed() - voted
    );
    Labelled {
        tiled,
        labels,
        transfer,
        stones,
    }
}

fn label_dam(survey: &Path, epoch: usize, sensor: &str) -> Labelled {
    let epoch_dir = survey.join(format!("epoch{epoch}"));
    let points = positions(&epoch_dir.join(format!("cloud_{sensor}.laz")));
    let truth = true_stones(&survey.join(format!("truth/epoch{epoch}_cloud_{sensor}_truth.laz")));
    assert_eq!(points.len(), truth.len());
    let views = read_cameras(&epoch_dir.join("cameras_metashape.xml"))
        .unwrap()
        .views;
    let masks = MaskSource::open(&survey.join(format!("truth/masks/epoch{epoch}_coco.json"))).unwrap();
    label(tiled(&points, &truth), &views, |image| {
        let view = views.iter().find(|v| v.image == image).unwrap();
        let photo = masks.labels_for(&view.name, view.camera.width, view.camera.height)?;
        Ok(photo.map(|p| p.labels))
    })
}

impl Labelled {
    fn confusion(&self) -> LabelConfusion {
        let mut confusion = LabelConfusion::default();
        for (&stone, &truth) in self.points() {
            if truth != OCCLUDER {
                confusion.add(stone, truth);
            }
        }
        confusion
    }

    /// Points on occluders, and those of them that carry a stone.
    fn occluders(&self) -> [usize; 2] {
        let on: Vec<u32> = self.points().filter(|p| *p.1 == OCCLUDER).map(|p| *p.0).collect();
        [on.len(), on.iter().filter(|s| **s != 0).count()]
    }

    /// Label and truth of every point.
    fn points(&self) -> impl Iterator<Item = (&u32, &u32)> {
        let labels = self.labels.tiles.iter().flat_map(|t| &t.stone);
        labels.zip(self.tiled.numbers.iter().flatten())
    }

    /// True stone that most points of each stone belong to.
    fn owners(&self) -> BTreeMap<u32, u32> {
        let mut best: BTreeMap<u32, (u64, u32)> = BTreeMap::new();
        for (p, t, n) in self.confusion().overlaps() {
            let entry = best.entry(p).or_default();
            *entry = (*entry).max((n, t));
        }
        best.into_iter().map(|(p, (_, t))| (p, t)).collect()
    }

    fn footprints(&self) -> Footprints {
        let mut footprints = Footprints::new();
        for (tile, labels) in self.labels.tiles.iter().enumerate() {
            let cloud = self.tiled.tiles.load(tile).unwrap();
            for (i, &stone) in labels.stone.iter().enumerate().filter(|s| *s.1 != 0) {
                footprints.add(StoneId(stone), &cloud.world(i));
            }
        }
        footprints
    }

    /// Whether a labelled or background point lies near a place.
    fn seen_cells(&self) -> BTreeSet<[i64; 3]> {
        let mut cells = BTreeSet::new();
        for tile in 0..self.tiled.tiles.tile_count() {
            let cloud = self.tiled.tiles.load(tile).unwrap();
            let seen = &self.labels.tiles[tile].seen;
            cells.extend(
                (0..cloud.len())
                    .filter(|&i| seen[i])
                    .map(|i| cell(&cloud.world(i))),
            );
        }
        cells
    }
}

fn cell(p: &Point3<f64>) -> [i64; 3] {
    [0, 1, 2].map(|a| (p[a] / 0.1).floor() as i64)
}

fn matched(first: &Labelled, second: &Labelled) -> MatchReport {
    let seen = second.seen_cells();
    let (footprints_1, footprints_2) = (first.footprints(), second.footprints());
    let overlap = footprint_overlap(&footprints_1, &footprints_2);
    let surroundings = Surroundings {
        covered: &|p| seen.contains(&cell(p)),
        overlap: Some(&overlap),
    };
    match_stones(
        &first.stones,
        &second.stones,
        &surroundings,
        &MatchParams::default(),
    )
}

/// Stones that count: measured in both epochs to 35 % of their face, not cut by the section's end.
fn countable(survey: &Path, sensor: &str) -> BTreeSet<u32> {
    let text = std::fs::read_to_string(survey.join("truth/stones.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let (id, edge, seen) = (
        column("stone_id"),
        column("edge"),
        column(&format!("vis_{sensor}")),
    );
    lines
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|row| row[edge] == "0" && row[seen].parse::<f64>().unwrap() >= 0.35)
        .map(|row| row[id].parse().unwrap())
        .collect()
}

struct Pairs {
    right: BTreeSet<u32>,
    wrong: usize,
    total: usize,
}

fn judge(report: &MatchReport, first: &BTreeMap<u32, u32>, second: &BTreeMap<u32, u32>) -> Pairs {
    let mut pairs = Pairs {
        right: BTreeSet::new(),
        wrong: 0,
        total: 0,
    };
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    for (StoneId(a), outcome) in &report.outcomes {
        let MatchOutcome::Matched { second: StoneId(b) } = outcome else {
            *reasons.entry(format!("{outcome:?}")).or_default() += 1;
            continue;
        };
        pairs.total += 1;
        match (first.get(a), second.get(b)) {
            (Some(s), Some(t)) if s == t => {
                pairs.right.insert(*s);
            }
            // A stone without a true one is neither right nor wrong.
            (Some(_), Some(_)) => pairs.wrong += 1,
            _ => {}
        }
    }
    println!("  shift {:.3?}, {reasons:?}", report.common_shift.as_slice());
    pairs
}

#[test]
fn dam_points_carry_their_stones_and_the_stones_match() {
    let Some(data) = data() else { return };
    for case in ["combo", "split"] {
        let survey = data.join("dam_small").join(case);
        for sensor in ["tls", "uav"] {
            let counted = countable(&survey, sensor);
            let epochs = [1, 2].map(|epoch| {
                println!("{case} epoch {epoch} {sensor}");
                label_dam(&survey, epoch, sensor)
            });
            for epoch in &epochs {
                let confusion = epoch.confusion();
                let score = confusion.score_labels(Some(&counted));
                let share = |n: u64| n as f64 / score.stone_points as f64;
                println!(
                    "  right {:.4} unlabelled {:.4} wrong {:.4}; on background {:.4} of {}",
                    score.right_share.unwrap(),
                    share(score.unlabelled),
                    share(score.wrong),
                    score.false_labels as f64 / score.background_points as f64,
                    score.background_points
                );
                let worst: Vec<_> = score.per_stone.iter().filter(|s| *s.1 < 0.8).collect();
                println!("  under 80 %: {worst:.2?}");
                let [occluders, labelled] = epoch.occluders();
                println!("  {labelled} of {occluders} points on occluders carry a stone");
                assert!(score.right_share.unwrap() >= 0.95);
                assert!(share(score.wrong) <= 0.002);
                assert!(labelled * 100 <= occluders);
            }
            let report = matched(&epochs[0], &epochs[1]);
            let pairs = judge(&report, &epochs[0].owners(), &epochs[1].owners());
            let found = pairs.right.intersection(&counted).count();
            println!(
                "  matched {found} of {} countable, {} wrong of {}",
                counted.len(),
                pairs.wrong,
                pairs.total
            );
            let missing: Vec<_> = counted.difference(&pairs.right).collect();
            println!("  missing {missing:?}");
            assert!(found * 100 >= 95 * counted.len() && pairs.wrong * 100 <= pairs.total);
        }
    }
}

/// The reference stone of every instance of a photo, and its label image.
#[test]
fn fountain_stones_are_found_and_matched() {
    let Some(data) = data() else { return };
    let source = MaskSource::open(&data.join("masks_real/fountain/instances.json")).unwrap();
    let epochs = [1, 2].map(|epoch| {
        println!("fountain epoch {epoch}");
        let folder = data.join(format!("fountain/epoch{epoch}"));
        let views = read_cameras(&folder.join("cameras.xml")).unwrap().views;
        let mut references: BTreeMap<(ImageId, u32), u64> = BTreeMap::new();
        let points = positions(&folder.join("cloud.laz"));
        let labelled = label(tiled(&points, &[]), &views, |image| {
            let view = views.iter().find(|v| v.image == image).unwrap();
            let name = format!("epoch{epoch}/images/{}", view.name);
            let photo = source.labels_for(&name, view.camera.width, view.camera.height)?;
            let Some(photo) = photo else { return Ok(None) };
            for instance in &photo.instances {
                references.insert((image, instance.id), instance.stone_ref.unwrap_or(0));
            }
            Ok(Some(photo.labels))
        });
        let owners = reference_owners(&labelled.transfer, &references);
        (labelled, owners)
    });
    let report = matched(&epochs[0].0, &epochs[1].0);
    let pairs = judge(&report, &epochs[0].1, &epochs[1].1);
    println!(
        "  right {} of 210, {} wrong of {}, {} outcomes",
        pairs.right.len(),
        pairs.wrong,
        pairs.total,
        report.outcomes.len()
    );
    let both: BTreeSet<u32> = [0, 1]
        .map(|e| epochs[e].1.values().copied().collect::<BTreeSet<u32>>())
        .into_iter()
        .reduce(|a, b| &a & &b)
        .unwrap();
    println!(
        "  in both epochs {}; not matched {:?}",
        both.len(),
        &both - &pairs.right
    );
    assert!(pairs.right.len() >= 185 && pairs.wrong * 100 <= pairs.total);
}

/// The reference stone of each stone: the one most of its instances stand for, where any stands for one.
fn reference_owners(transfer: &Transfer, references: &BTreeMap<(ImageId, u32), u64>) -> BTreeMap<u32, u32> {
    let mut owners = BTreeMap::new();
    let mut clean = BTreeMap::<u32, usize>::new();
    for stone in &transfer.stones {
        let mut votes: BTreeMap<u64, usize> = BTreeMap::new();
        for (image, instance) in &stone.instances {
            let reference = references[&(*image, instance.0)];
            if reference != 0 {
                *votes.entry(reference).or_default() += 1;
            }
        }
        let Some((&reference, _)) = votes.iter().max_by_key(|v| v.1) else {
            continue;
        };
        owners.insert(stone.stone.0, reference as u32);
        *clean.entry(reference as u32).or_default() += if votes.len() == 1 { 1 } else { 100 };
    }
    let single = clean.values().filter(|c| **c == 1).count();
    println!(
        "  {} reference stones found, {single} as one clean stone",
        clean.len()
    );
    assert!(single >= 190);
    owners
}
