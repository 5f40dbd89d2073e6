//! Disk, memory and time that a run will need, and what is there.

use super::Depth;
use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::Project;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use stonewise_base::address_space;
use stonewise_base::address_space::detector_memory;
use stonewise_base::error::Result;
use stonewise_core::parallel::on_one_thread;
use stonewise_core::raster::Raster;
use stonewise_io::cloud::claimed_records;
use stonewise_segment::tiling::TilingOptions;
use stonewise_segment::{Detector, StoneFinder, Weights};

/// Disk that a point needs while a run works: tiles, labels, pairs of stones, the labelled cloud. Measured on
/// surveys of 1 to 200 million points (docs/src/performance.md), rounded up.
const DISK_PER_POINT: u64 = 90;
/// Memory at rest, for each of the first ten million points, most of it for photos, and for each other point: 238 MB
/// at 1.3 million points, 466 MB at 5.2 million, 0.9 GB at 27 million, 1.2 GB at 105 million, 3.4 GB at 332 million.
const MEMORY_BASE: u64 = 200 << 20;
const FIRST_POINTS: u64 = 10_000_000;
const MEMORY_PER_FIRST_POINT: u64 = 52;
const MEMORY_PER_OTHER_POINT: u64 = 14;
/// Processor time for each of the first points and for each other one, without the search for stones, where a tile
/// takes [`SECONDS_PER_TILE`]: 27 us a point at 1.3 million points, 19 at 5.2 million, 11 at 27 million and at 332
/// million. It depends on the number of stones, which is not known yet.
const SECONDS_PER_FIRST_POINT: f64 = 2.2e-5;
const SECONDS_PER_OTHER_POINT: f64 = 1.0e-5;
/// Share of that time where photos track no stones: 0.79 at 1 million points, 0.69 at 332 million.
const WITHOUT_PHOTOS: f64 = 0.75;
/// Processor time of a tile of the detector on the machine on which the others were measured.
const SECONDS_PER_TILE: f64 = 0.3;
/// Edge of the image on which the speed of the machine is measured, pixels.
const TILE_PX: u32 = 640;
/// Factor by which a run may take longer or less: the number of stones is not known yet.
const SPREAD: f64 = 1.4;
const GIB: f64 = (1u64 << 30) as f64;

/// `photos`: width and height of those in which stones are searched for, pixels.
pub(super) fn look(
    project: &Project,
    surveys: &[Option<Sample>],
    photos: &[[u32; 2]],
    depth: Depth,
    out: &Path,
) -> Vec<Finding> {
    let points: u64 = surveys.iter().flatten().map(|s| s.records).sum();
    let time = match depth {
        Depth::Full => tile_seconds().map(|tile| time(project, points, photos, tile)),
        Depth::Quick => None,
    };
    [
        amount(
            "disk",
            DISK_PER_POINT * points,
            free_disk(out),
            "make room, or give --out on another disk",
        ),
        amount(
            "memory",
            memory(project, points),
            free_memory(),
            "end other programs, or run on a part of the survey",
        ),
    ]
    .into_iter()
    .chain(time.map(|text| Finding::new("", "time", Verdict::Fine, text)))
    .collect()
}

/// How long the run will take on this machine, on which a tile of the detector takes `tile` seconds.
fn time(project: &Project, points: u64, photos: &[[u32; 2]], tile: f64) -> String {
    let cores = rayon::current_num_threads().max(1);
    let has_tracks =
        project.settings.registration.photos.enabled && project.epochs.iter().any(|e| e.photos.is_some());
    let of_points = match has_tracks {
        true => seconds_of_points(points),
        false => WITHOUT_PHOTOS * seconds_of_points(points),
    };

    // Enlarged photos are looked at in few places.
    let mut tiling = project.settings.segment.tiling.clone();
    tiling.scales.retain(|scale| *scale <= 1.0);
    let tiles: u64 = photos
        .iter()
        .map(|[width, height]| tiling.tile_count(*width, *height, 1.0))
        .sum();
    let seconds = tile * (of_points / SECONDS_PER_TILE + tiles as f64) / cores as f64;
    let views = match project.epochs.ids().any(|e| project.has_views(e)) {
        true => ", plus the search for stones in views of the clouds",
        false => "",
    };

    let on = match cores {
        1 => "one core".to_owned(),
        _ => format!("{cores} cores"),
    };
    let minutes = |factor: f64| (seconds * factor / 60.0).round().max(1.0);
    let (low, high) = (minutes(1.0 / SPREAD), minutes(SPREAD));
    match low < high {
        true => format!("{low} to {high} min on {on}{views}"),
        false => format!("about {low} min on {on}{views}"),
    }
}

/// Processor time of a run of this many points, on the machine on which it was measured.
fn seconds_of_points(points: u64) -> f64 {
    let first = points.min(FIRST_POINTS);
    SECONDS_PER_FIRST_POINT * first as f64 + SECONDS_PER_OTHER_POINT * (points - first) as f64
}

/// Seconds that this machine takes for one tile of the detector, on one thread: the faster of two. `None` where the
/// limit on the address space leaves no room for it.
fn tile_seconds() -> Option<f64> {
    if address_space::room().is_some_and(|room| room < detector_memory()) {
        return None;
    }
    let finder = StoneFinder::open(&Weights::BuiltIn, TilingOptions::default().min_score as f32).ok()?;
    // Noise of grey values: what the image shows hardly matters for the time.
    let grey = |i: u32| [(i.wrapping_mul(2_654_435_761) >> 24) as u8; 3];
    let image = Raster::from_vec(TILE_PX, TILE_PX, (0..TILE_PX * TILE_PX).map(grey).collect())?;
    let once = || {
        let begin = Instant::now();
        on_one_thread(|| finder.detect(&image, None)).ok()?;
        Some(begin.elapsed().as_secs_f64())
    };
    Some(once()?.min(once()?))
}

/// What is needed beside what is free, bytes; `None`: the system does not report how much is free.
fn amount(topic: &str, needed: u64, free: Option<u64>, advice: &str) -> Finding {
    let needs = format!("about {:.1} GB needed", (needed as f64 / GIB).max(0.1));
    let (verdict, text) = match free {
        None => (Verdict::Note, format!("{needs}; what is free is not known here")),
        Some(free) => {
            let text = format!("{needs}, {:.1} GB free", free as f64 / GIB);
            match free < needed {
                true => (Verdict::Doubt, format!("{text}: {advice}")),
                false => (Verdict::Fine, text),
            }
        }
    };
    Finding::new("", topic, verdict, text)
}

/// Compares the limit on the address space with what a run of a project takes, from the points that the
/// clouds claim.
///
/// # Errors
/// The limit is too low; a cloud cannot be read.
pub fn require_memory_of_run(project: &Project) -> Result<()> {
    require(project, |points| memory(project, points), "a run of this survey")
}

/// Compares the limit on the address space with what a comparison of the clouds of a project takes, without
/// the photos.
///
/// # Errors
/// The limit is too low; a cloud cannot be read.
pub fn require_memory_of_clouds(project: &Project) -> Result<()> {
    require(project, memory_of_points, "the comparison of these clouds")
}

/// Heads of clouds are only read where there is a limit.
fn require(project: &Project, memory: impl Fn(u64) -> u64, what: &str) -> Result<()> {
    if address_space::room().is_none() {
        return Ok(());
    }
    let mut points: u64 = 0;
    for cloud in project.epochs.iter().flat_map(|e| &e.clouds) {
        points = points.saturating_add(claimed_records(cloud)?.unwrap_or(0));
    }
    address_space::require(memory(points), what)
}

fn memory(project: &Project, points: u64) -> u64 {
    let detector = match project.epochs.iter().any(|e| e.masks.is_none()) {
        true => detector_memory(),
        false => 0,
    };
    memory_of_points(points).saturating_add(detector)
}

fn memory_of_points(points: u64) -> u64 {
    let first = points.min(FIRST_POINTS);
    let others = MEMORY_PER_OTHER_POINT.saturating_mul(points - first);
    (MEMORY_BASE + MEMORY_PER_FIRST_POINT * first).saturating_add(others)
}

/// Whether a finding concerns free disk or memory, and not the survey.
pub fn is_about_this_machine(finding: &Finding) -> bool {
    ["disk", "memory", "time"].contains(&finding.topic.as_str())
}

/// Free bytes where a folder is, or will be, as `df` tells.
pub fn free_disk(out: &Path) -> Option<u64> {
    let there = std::path::absolute(out).ok()?;
    let there = there.ancestors().find(|p| p.exists())?;
    let answer = Command::new("df").arg("-Pk").arg(there).output().ok()?;
    let text = String::from_utf8_lossy(&answer.stdout).into_owned();
    parse_df(&text)
}

/// Fourth column of the second line, in blocks of 1024 bytes (POSIX format).
fn parse_df(text: &str) -> Option<u64> {
    let line = text.lines().nth(1)?;
    // The name of a device may hold blanks: columns are counted from the one that ends with a per cent sign.
    let columns: Vec<&str> = line.split_whitespace().collect();
    let percent = columns.iter().position(|c| c.ends_with('%'))?;
    columns
        .get(percent.checked_sub(1)?)?
        .parse::<u64>()
        .ok()
        .map(|k| k * 1024)
}

/// Memory that this process can still get, where Linux tells: what is available, or less where it is limited.
pub fn free_memory() -> Option<u64> {
    let meminfo = fs::read_to_string("/proc/meminfo").ok()?;
    let line = meminfo.lines().find(|l| l.starts_with("MemAvailable:"))?;
    let available = line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024;
    Some(available.min(address_space::room().unwrap_or(u64::MAX)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_than_needed_is_a_doubt_with_advice() {
        let look = |free| amount("memory", 3 << 30, free, "end other programs");
        let short = look(Some((3 << 30) - 1));
        assert_eq!(short.verdict, Verdict::Doubt);
        assert_eq!(short.text, "about 3.0 GB needed, 3.0 GB free: end other programs");
        assert!(is_about_this_machine(&short));
        let enough = look(Some(3 << 30));
        assert_eq!(
            (enough.verdict, &*enough.text),
            (Verdict::Fine, "about 3.0 GB needed, 3.0 GB free")
        );
        let unknown = look(None);
        assert_eq!(unknown.verdict, Verdict::Note);
        assert!(unknown.text.ends_with("not known here"), "{}", unknown.text);
    }

    /// Points of surveys, and the peak memory of their runs, MB: dam_small, fountain, and a sixteenth, a quarter and
    /// the whole of a dam.
    const MEASURED: [(u64, u64); 5] = [
        (1_280_000, 238),
        (5_200_000, 466),
        (26_600_000, 903),
        (104_600_000, 1_188),
        (332_000_000, 3_442),
    ];
    /// Processor time of the same runs, without the quarter, seconds.
    const TIMES: [(u64, f64); 4] = [
        (1_280_000, 34.0),
        (5_200_000, 100.0),
        (26_600_000, 292.0),
        (332_000_000, 3611.0),
    ];

    #[test]
    fn memory_is_enough_for_runs_that_were_measured_and_not_twice_as_much() {
        for (points, megabytes) in MEASURED {
            let counted = memory_of_points(points) / 1_000_000;
            assert!(
                (megabytes..2 * megabytes).contains(&counted),
                "{points}: {counted} MB, measured {megabytes}"
            );
        }
        assert_eq!(memory_of_points(u64::MAX), u64::MAX);
    }

    #[test]
    fn the_time_of_runs_that_were_measured_is_within_the_spread() {
        for (points, seconds) in TIMES {
            let factor = seconds_of_points(points) / seconds;
            assert!(
                (1.0 / SPREAD..SPREAD).contains(&factor),
                "{points}: {factor} times the time measured"
            );
        }
    }

    #[test]
    fn the_posix_answer_of_df_is_read() {
        let text = "Filesystem     1024-blocks      Used Available Capacity Mounted on\n\
                    //nas/some share  976284628 123456 852760 13% /mnt/dam data\n";
        assert_eq!(parse_df(text), Some(852_760 * 1024));
        assert_eq!(parse_df("df: no such file\n"), None);
    }
}
