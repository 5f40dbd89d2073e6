//! Boxes of the unrolled wall, found by place.

use nalgebra::Point2;
use std::collections::BTreeMap;

/// Edge of the squares, metres.
const SQUARE_M: f64 = 0.5;

/// Numbers of boxes by the squares that they touch.
#[derive(Debug, Default)]
pub struct Squares {
    boxes: BTreeMap<(i64, i64), Vec<usize>>,
}

impl Squares {
    /// Adds box `number` from its lowest to its highest corner, metres.
    pub fn add(&mut self, number: usize, low: &Point2<f64>, high: &Point2<f64>) {
        let (from, to) = (square(low), square(high));
        for x in from.0..=to.0 {
            for y in from.1..=to.1 {
                self.boxes.entry((x, y)).or_default().push(number);
            }
        }
    }

    /// The boxes that touch the square of a place, in the order in which they were added.
    pub fn near(&self, place: &Point2<f64>) -> &[usize] {
        self.boxes.get(&square(place)).map_or(&[], Vec::as_slice)
    }
}

fn square(p: &Point2<f64>) -> (i64, i64) {
    ((p.x / SQUARE_M).floor() as i64, (p.y / SQUARE_M).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_near_every_place_in_it() {
        let mut squares = Squares::default();
        squares.add(4, &Point2::new(-0.7, 0.2), &Point2::new(0.1, 0.3));
        squares.add(9, &Point2::new(5.0, 5.0), &Point2::new(5.1, 5.1));
        for (place, expected) in [
            ([-0.6, 0.25], &[4][..]),
            ([0.05, 0.3], &[4]),
            ([5.05, 5.05], &[9]),
            ([2.0, 0.25], &[]),
        ] {
            assert_eq!(squares.near(&place.into()), expected, "{place:?}");
        }
    }
}
