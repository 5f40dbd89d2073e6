//! Connected components.

use super::{LabelImage, Raster};

/// Pixels of one label that hang together by their sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// The label its pixels carry.
    pub label: u32,
    /// Number of pixels.
    pub area: u32,
}

/// Splits every label but 0 into parts that hang together by their sides (4-neighbours).
///
/// Returns an image of part numbers, 0 for background and n for `parts[n - 1]`; parts are numbered by their
/// first pixel in row order. Cost: O(pixels), two passes with union-find.
pub fn connected_components(labels: &LabelImage) -> (LabelImage, Vec<Component>) {
    let (width, height) = (labels.width() as usize, labels.height() as usize);
    let data = labels.data();
    let mut parent: Vec<u32> = Vec::new();
    let mut numbers = vec![0u32; data.len()];

    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            if data[i] == 0 {
                continue;
            }
            let left = if x > 0 && data[i - 1] == data[i] {
                numbers[i - 1]
            } else {
                0
            };
            let above = if y > 0 && data[i - width] == data[i] {
                numbers[i - width]
            } else {
                0
            };
            numbers[i] = match (left, above) {
                (0, 0) => {
                    parent.push(parent.len() as u32);
                    parent.len() as u32
                }
                (number, 0) | (0, number) => number,
                (a, b) => join(&mut parent, a - 1, b - 1) + 1,
            };
        }
    }

    let mut parts: Vec<Component> = Vec::new();
    let mut final_number = vec![0u32; parent.len()];
    for (number, &label) in numbers.iter_mut().zip(data) {
        if *number == 0 {
            continue;
        }
        let root = find(&mut parent, *number - 1) as usize;
        if final_number[root] == 0 {
            parts.push(Component { label, area: 0 });
            final_number[root] = parts.len() as u32;
        }
        *number = final_number[root];
        parts[*number as usize - 1].area += 1;
    }

    let image = Raster::from_vec(labels.width(), labels.height(), numbers);
    (
        image.unwrap_or_else(|| Raster::filled(labels.width(), labels.height(), 0)),
        parts,
    )
}

fn find(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}

/// Joins two sets and returns the root, the smaller of both.
fn join(parent: &mut [u32], a: u32, b: u32) -> u32 {
    let (a, b) = (find(parent, a), find(parent, b));
    let (low, high) = (a.min(b), a.max(b));
    parent[high as usize] = low;
    low
}
