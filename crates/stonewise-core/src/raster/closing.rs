//! Closing of small gaps in an image of yes and no.

/// Morphological closing with a square of `2 half_gap + 1` pixels: the pixels that such a square, while it fits into
/// what is not `known`, never covers. `known`: row by row; outside the image nothing counts. Cost: O(pixels).
pub fn closed(known: &[bool], width: usize, height: usize, half_gap: usize) -> Vec<bool> {
    let dilated = spread(known, width, height, half_gap, true);
    spread(&dilated, width, height, half_gap, false)
}

/// Lets one value win wherever it occurs within the square around a pixel; outside the image nothing counts.
fn spread(pixels: &[bool], width: usize, height: usize, half_side: usize, winner: bool) -> Vec<bool> {
    let along = |from: &[bool], length: usize, at: &dyn Fn(usize) -> usize, into: &mut [bool]| {
        let mut last: Option<usize> = None;
        let mut next = 0;
        for i in 0..length {
            while next < length && next <= i + half_side {
                if from[at(next)] == winner {
                    last = Some(next);
                }
                next += 1;
            }
            let is_near = last.is_some_and(|l| l + half_side >= i);
            into[at(i)] = if is_near { winner } else { !winner };
        }
    };
    let mut rows = vec![!winner; pixels.len()];
    for y in 0..height {
        along(pixels, width, &|x| y * width + x, &mut rows);
    }
    let mut both = vec![!winner; pixels.len()];
    for x in 0..width {
        along(&rows, height, &|y| y * width + x, &mut both);
    }
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_is_that_of_brute_force() {
        let (width, height, half_gap) = (37, 29, 8);
        let known: Vec<bool> = (0..width * height)
            .map(|i| (i * i * 31 + i * 7) % 97 < 3)
            .collect();
        let found = closed(&known, width, height, half_gap);
        let around = |x: usize, y: usize| {
            let r = half_gap;
            (y.saturating_sub(r)..=(y + r).min(height - 1))
                .flat_map(move |v| (x.saturating_sub(r)..=(x + r).min(width - 1)).map(move |u| (u, v)))
        };
        let dilated = |x, y| around(x, y).any(|(u, v)| known[v * width + u]);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let expected = around(x, y).all(|(u, v)| dilated(u, v));
            assert_eq!(found[y * width + x], expected, "{x} {y}");
        }
    }
}
