//! Disk, memory and time that a run will need, and what is there.

use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::Project;
use std::fs;
use std::path::Path;
use std::process::Command;
use stonewise_base::address_space;
use stonewise_base::address_space::detector_memory;
use stonewise_base::error::Result;
use stonewise_io::cloud::claimed_records;

/// Disk that a point needs while a run works: tiles, labels, pairs of stones, the labelled cloud. Measured on
/// surveys of 1 to 200 million points (docs/src/performance.md), rounded up.
const DISK_PER_POINT: u64 = 90;
/// Memory at rest, and per point: 185 MB at 1.3 million points, 404 MB at 5.2 million, 4.9 GB at 133 million.
const MEMORY_BASE: u64 = 200 << 20;
const MEMORY_PER_POINT: u64 = 45;
/// Processor time per point: 10 us at 1.3 million points, 9 at 5.2 million, 10 at 133 million.
const SECONDS_PER_POINT: f64 = 2e-5;
const GIB: f64 = (1u64 << 30) as f64;

pub(super) fn look(project: &Project, surveys: &[Option<Sample>], out: &Path) -> Vec<Finding> {
    let points: u64 = surveys.iter().flatten().map(|s| s.records).sum();
    let cores = rayon::current_num_threads().max(1);
    let minutes = 0.1 + SECONDS_PER_POINT * points as f64 / cores as f64 / 60.0;
    let without_masks = project.epochs.iter().filter(|e| e.masks.is_none()).count();
    let search = match without_masks {
        0 => String::new(),
        1 => "; the search for stones in the photos of 1 epoch comes on top".to_owned(),
        n => format!("; the search for stones in the photos of {n} epochs comes on top"),
    };
    vec![
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
        Finding::new(
            "",
            "time",
            Verdict::Fine,
            format!("about {:.0} min on {cores} cores{search}", minutes.max(1.0)),
        ),
    ]
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
    // The photos are looked at before most points are in memory.
    memory_of_points(points).max(detector)
}

fn memory_of_points(points: u64) -> u64 {
    MEMORY_BASE.saturating_add(MEMORY_PER_POINT.saturating_mul(points))
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

    #[test]
    fn the_posix_answer_of_df_is_read() {
        let text = "Filesystem     1024-blocks      Used Available Capacity Mounted on\n\
                    //nas/some share  976284628 123456 852760 13% /mnt/dam data\n";
        assert_eq!(parse_df(text), Some(852_760 * 1024));
        assert_eq!(parse_df("df: no such file\n"), None);
    }
}
