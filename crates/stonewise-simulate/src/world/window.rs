//! Pieces of a section that are worked on one after the other, so that a dam of any size fits into memory.

/// Edge of a piece, metres: its surface takes about 90 MB.
const WINDOW_M: f64 = 8.0;
/// How much of the wall around a piece is there too, metres: all of a stone whose middle lies in it, and, as
/// what stands out by 5 cm hides no more than that under all but grazing beams, all that hides any of it.
const AROUND_M: f64 = 1.0;

/// A piece of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Its number; noise of different pieces differs.
    number: u64,
    /// Smallest a, largest a, smallest u, largest u, metres; infinite where the section ends.
    core: [f64; 4],
}

impl Window {
    /// The whole section in one piece.
    pub fn whole() -> Self {
        Self {
            number: 0,
            core: [f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// Pieces of about 8 x 8 m that cover a section of this extent (smallest a, largest a, smallest u,
    /// largest u, metres).
    pub fn cover(extent: [f64; 4]) -> Vec<Self> {
        let counts = [0, 2].map(|i| ((extent[i + 1] - extent[i]) / WINDOW_M).round().max(1.0) as u64);
        let edge = |axis: usize, i: u64| match i {
            0 => f64::NEG_INFINITY,
            i if i == counts[axis] => f64::INFINITY,
            i => {
                let [low, high] = [extent[2 * axis], extent[2 * axis + 1]];
                low + (high - low) * i as f64 / counts[axis] as f64
            }
        };
        (0..counts[0] * counts[1])
            .map(|number| {
                let (i, j) = (number / counts[1], number % counts[1]);
                Self {
                    number,
                    core: [edge(0, i), edge(0, i + 1), edge(1, j), edge(1, j + 1)],
                }
            })
            .collect()
    }

    /// Whether a place on the face belongs to this piece; every place belongs to exactly one.
    pub fn holds(&self, a: f64, u: f64) -> bool {
        let [a0, a1, u0, u1] = self.core;
        a0 <= a && a < a1 && u0 <= u && u < u1
    }

    /// The part of the wall that must be there to work on this piece of a section of this extent.
    pub fn surroundings(&self, extent: [f64; 4]) -> [f64; 4] {
        self.grown(AROUND_M, extent)
    }

    /// The piece, larger by a margin on every side, and no larger than `limits`.
    pub(super) fn grown(&self, margin_m: f64, limits: [f64; 4]) -> [f64; 4] {
        let c = self.core;
        [
            (c[0] - margin_m).max(limits[0]),
            (c[1] + margin_m).min(limits[1]),
            (c[2] - margin_m).max(limits[2]),
            (c[3] + margin_m).min(limits[3]),
        ]
    }

    /// A number for a stream of random numbers that no other piece, station or row has.
    pub(super) fn stream(&self, station: u64, row: u64) -> u64 {
        (station + 1) << 48 | self.number << 24 | row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_belongs_to_one_piece_and_its_surroundings_are_there() {
        let extent = [-20.0, 20.0, -0.25, 27.7];
        let pieces = Window::cover(extent);
        assert_eq!(pieces.len(), 15);
        for k in 0..5000 {
            let a = -21.0 + 42.0 * f64::from(k % 71) / 70.0;
            let u = -1.0 + 30.0 * f64::from(k / 71) / 70.0;
            let owners: Vec<&Window> = pieces.iter().filter(|w| w.holds(a, u)).collect();
            assert_eq!(owners.len(), 1, "{a} {u}");
            let around = owners[0].surroundings(extent);
            let inside = a >= extent[0] && a <= extent[1] && u >= extent[2] && u <= extent[3];
            let there = around[0] <= a && a <= around[1] && around[2] <= u && u <= around[3];
            assert_eq!(inside, there, "{a} {u}");
        }
        assert_eq!(Window::cover([-2.0, 2.0, 0.0, 3.0]).len(), 1);
        assert_eq!(Window::cover([-2.0, 2.0, 0.0, 3.0])[0], Window::whole());
    }
}
