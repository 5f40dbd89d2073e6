//! Which grid points are worth a look: no other is better in both ways.

/// A share of the most stones that the recommended point must measure at least: 0.95, because the paper
/// chooses by the lowest RMSE and by the most matches at once, and a gain in accuracy is not worth more than
/// a twentieth of the stones.
const ENOUGH: f64 = 0.95;

/// What a grid point is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worth {
    /// Stones measured.
    pub stones: f64,
    /// Their RMSE, metres; points without one are never on the front.
    pub rmse_m: Option<f64>,
    /// Parameters that differ from the project's own: of equal points the one that changes least is kept.
    pub changes: usize,
}

/// Indices of the points that no other beats: more stones at the same error, or less error with as many
/// stones. Ascending by number of stones.
pub(super) fn front(points: &[Worth]) -> Vec<usize> {
    let mut order: Vec<(usize, f64)> = points
        .iter()
        .enumerate()
        .filter_map(|(i, p)| Some((i, p.rmse_m?)))
        .collect();
    order.sort_by(|&(a, rmse_a), &(b, rmse_b)| {
        let (p, q) = (&points[a], &points[b]);
        let better = q.stones.total_cmp(&p.stones).then(rmse_a.total_cmp(&rmse_b));
        better.then((p.changes, a).cmp(&(q.changes, b)))
    });
    let mut least = f64::INFINITY;
    let mut front = Vec::new();
    for (i, rmse) in order {
        if rmse < least {
            least = rmse;
            front.push(i);
        }
    }
    front.reverse();
    front
}

/// The point of the front with the lowest RMSE among those that measure nearly the most stones.
pub(super) fn recommended(points: &[Worth]) -> Option<usize> {
    let front = front(points);
    let most = points[*front.last()?].stones;
    // Along the front the error rises with the number of stones: the first that measures enough has the
    // least.
    front.into_iter().find(|&i| points[i].stones >= ENOUGH * most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worth(stones: f64, rmse_m: Option<f64>, changes: usize) -> Worth {
        Worth {
            stones,
            rmse_m,
            changes,
        }
    }

    #[test]
    fn the_front_is_what_nobody_beats() {
        let points = [
            worth(100.0, Some(5.0), 0),
            worth(98.0, Some(2.0), 2),
            worth(98.0, Some(2.0), 1),
            worth(98.0, Some(3.0), 0),
            worth(60.0, Some(1.0), 0),
            worth(50.0, Some(1.0), 0),
            worth(0.0, None, 0),
        ];
        assert_eq!(front(&points), [4, 2, 0]);
        assert_eq!(recommended(&points), Some(2));
        assert_eq!(recommended(&[worth(0.0, None, 0)]), None);
        assert_eq!(front(&[]), Vec::<usize>::new());
    }

    #[test]
    fn the_front_agrees_with_its_definition() {
        let many: Vec<Worth> = (0..60u32)
            .map(|i| worth(f64::from(i * 37 % 23), Some(f64::from(i * 29 % 19)), 0))
            .collect();
        let found = front(&many);
        for (i, p) in many.iter().enumerate() {
            let as_good = |q: &Worth| q.stones >= p.stones && q.rmse_m <= p.rmse_m;
            let beaten = many.iter().any(|q| as_good(q) && q != p);
            let twin = many[..i].contains(p);
            assert_eq!(found.contains(&i), !beaten && !twin, "{i}");
        }
    }
}
