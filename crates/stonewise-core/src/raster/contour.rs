//! Outlines of labels along pixel edges.

use super::LabelImage;
use std::collections::BTreeMap;

/// A closed ring of pixel corners; the last vertex joins the first.
pub type Ring = Vec<[f64; 2]>;

/// Outlines of every label but 0: rings along pixel edges, with corners only.
///
/// Filling a label's rings by the even-odd rule gives its pixels back exactly. Outer rings have positive
/// [area](crate::geometry::signed_area), holes negative. Pixels that touch only at a corner are apart. Cost: O(pixels + boundary).
pub fn label_outlines(labels: &LabelImage) -> BTreeMap<u32, Vec<Ring>> {
    let mut edges: BTreeMap<u32, Edges> = BTreeMap::new();
    let (width, height) = (labels.width(), labels.height());
    for y in 0..height {
        for x in 0..width {
            let label = labels.get(x, y).copied().unwrap_or(0);
            if label == 0 {
                continue;
            }
            let differs = |dx: i64, dy: i64| {
                let (nx, ny) = (i64::from(x) + dx, i64::from(y) + dy);
                let neighbour = u32::try_from(nx).ok().zip(u32::try_from(ny).ok());
                neighbour.and_then(|(nx, ny)| labels.get(nx, ny)) != Some(&label)
            };
            let sides = [
                (differs(0, -1), (x, y), Heading::Right),
                (differs(1, 0), (x + 1, y), Heading::Down),
                (differs(0, 1), (x + 1, y + 1), Heading::Left),
                (differs(-1, 0), (x, y + 1), Heading::Up),
            ];
            for (is_border, (cx, cy), heading) in sides {
                if is_border {
                    *edges.entry(label).or_default().entry((cy, cx)).or_default() |= heading.bit();
                }
            }
        }
    }

    edges
        .into_iter()
        .map(|(label, edges)| (label, link(edges)))
        .collect()
}

/// Border edges by the corner (y, x) they start from, a bit for each heading; the label lies to the right of
/// each.
type Edges = BTreeMap<(u32, u32), u8>;

#[derive(Clone, Copy, PartialEq)]
enum Heading {
    Right,
    Down,
    Left,
    Up,
}

impl Heading {
    const ALL: [Self; 4] = [Self::Right, Self::Down, Self::Left, Self::Up];

    fn bit(self) -> u8 {
        1 << self as u8
    }

    fn turned(self, quarters_right: usize) -> Self {
        Self::ALL[(self as usize + quarters_right) % 4]
    }

    fn step(self, (y, x): (u32, u32)) -> (u32, u32) {
        match self {
            Self::Right => (y, x + 1),
            Self::Down => (y + 1, x),
            Self::Left => (y, x - 1),
            Self::Up => (y - 1, x),
        }
    }
}

fn link(mut edges: Edges) -> Vec<Ring> {
    let mut rings = Vec::new();
    while let Some((&start, &bits)) = edges.first_key_value() {
        let Some(first) = Heading::ALL.into_iter().find(|h| bits & h.bit() != 0) else {
            edges.remove(&start);
            continue;
        };
        let mut ring = Ring::new();
        let (mut corner, mut heading) = (start, first);
        loop {
            remove(&mut edges, corner, heading);
            corner = heading.step(corner);
            let bits = edges.get(&corner).copied().unwrap_or(0);
            // Right turns first: at a corner where two pixels touch, this keeps them apart.
            let next = [1, 0, 3]
                .map(|q| heading.turned(q))
                .into_iter()
                .find(|h| bits & h.bit() != 0);
            let turned = next.is_none_or(|next| next != heading);
            if turned {
                ring.push([f64::from(corner.1), f64::from(corner.0)]);
            }
            match next {
                Some(next) => heading = next,
                None => break,
            }
        }
        rings.push(ring);
    }

    rings
}

fn remove(edges: &mut Edges, corner: (u32, u32), heading: Heading) {
    if let Some(bits) = edges.get_mut(&corner) {
        *bits &= !heading.bit();
        if *bits == 0 {
            edges.remove(&corner);
        }
    }
}
