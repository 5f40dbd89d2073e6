//! Stones in tables of results, and edits of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Who made the edits of a test.
pub const SIGNED: &str = r#""who": "A. Keller", "when": "2026-11-20", "why": "seen on site""#;

/// Rows of a CSV file by the cell of its first column, each by the names of the columns; cells hold no
/// commas.
pub fn rows(path: &Path) -> BTreeMap<u32, BTreeMap<String, String>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells: BTreeMap<String, String> = head
            .iter()
            .map(|h| (*h).to_owned())
            .zip(line.split(',').map(str::to_owned))
            .collect();
        (line.split(',').next().unwrap().parse().unwrap(), cells)
    };
    lines.map(row).collect()
}

pub fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap()
}

pub fn place(row: &BTreeMap<String, String>) -> [f64; 2] {
    [number(row, "along_m"), number(row, "up_m")]
}

/// Measured stones with a face of more than 0.02 m^2, by number.
pub fn inner(stones: &BTreeMap<u32, BTreeMap<String, String>>) -> Vec<u32> {
    let ok = stones
        .iter()
        .filter(|s| s.1["status"] == "ok" && number(s.1, "area_m2") > 0.02);
    ok.map(|s| *s.0).collect()
}

/// The measured stone nearest to another.
pub fn nearest(stones: &BTreeMap<u32, BTreeMap<String, String>>, to: u32, but: &[u32]) -> u32 {
    let [x, y] = place(&stones[&to]);
    let distance = |id: &u32| {
        let [a, b] = place(&stones[id]);
        (a - x).hypot(b - y)
    };
    let others = inner(stones)
        .into_iter()
        .filter(|id| *id != to && !but.contains(id));
    others.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
}
