//! Matching on walls made of centroids and areas, where the partners are known.

use nalgebra::{Point3, Vector3};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stonewise_core::id::StoneId;
use stonewise_core::matching::{MatchParams, MatchReport, Surroundings, match_stones};
use stonewise_core::stone::{MatchOutcome, Stone, UnmatchedReason};

const PITCH: f64 = 0.3;

fn stone(id: u32, centroid: Point3<f64>, area_m2: f64) -> Stone {
    Stone {
        id: StoneId(id),
        centroid,
        normal: Vector3::x(),
        area_m2,
        points: 500,
        photos: 4,
        confidence: 1.0,
    }
}

/// Rubble: a grid whose centroids are off by up to a fifth of the pitch and whose faces differ by a factor of
/// two.
fn rubble(seed: u64) -> Vec<Stone> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..40 * 20)
        .map(|i| {
            let mut off = || rng.random_range(-0.2..0.2) * PITCH;
            let centre = Point3::new(
                0.3 * off(),
                f64::from(i % 40) * PITCH + off(),
                f64::from(i / 40) * PITCH + off(),
            );
            stone(i as u32 + 1, centre, rng.random_range(0.035..0.07))
        })
        .collect()
}

/// The second epoch: every stone moved, centroids and areas measured anew, ids 1000 higher.
fn moved(stones: &[Stone], seed: u64, field: impl Fn(&Point3<f64>) -> Vector3<f64>) -> Vec<Stone> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    stones
        .iter()
        .map(|s| {
            let mut noise = || rng.random_range(-0.005..0.005);
            let error = Vector3::new(noise(), noise(), noise());
            let area = s.area_m2 * rng.random_range(0.9..1.1);
            stone(s.id.0 + 1000, s.centroid + field(&s.centroid) + error, area)
        })
        .collect()
}

fn run(first: &[Stone], second: &[Stone], params: &MatchParams) -> MatchReport {
    let surroundings = Surroundings {
        covered: &|_| true,
        overlap: None,
    };
    match_stones(first, second, &surroundings, params)
}

/// Right, wrong and missing matches where id + 1000 is the partner.
fn count(report: &MatchReport) -> [usize; 3] {
    let mut counts = [0; 3];
    for (StoneId(a), outcome) in &report.outcomes {
        match outcome {
            MatchOutcome::Matched { second } if second.0 == a + 1000 => counts[0] += 1,
            MatchOutcome::Matched { .. } => counts[1] += 1,
            MatchOutcome::Unmatched(_) => counts[2] += 1,
        }
    }
    counts
}

#[test]
fn the_papers_test_ends_where_its_equation_says() {
    // A regular row of equal stones: the ratio is s / (D - s), which reaches 0.4 at s = 0.4 D / 1.4.
    let row: Vec<Stone> = (0..30)
        .map(|i| stone(i + 1, Point3::new(0.0, f64::from(i) * PITCH, 0.0), 0.05))
        .collect();
    for (share, matches) in [(0.0, 30), (0.284, 30), (0.288, 1)] {
        let second: Vec<Stone> = row
            .iter()
            .map(|s| stone(s.id.0 + 1000, s.centroid + Vector3::y() * (share * PITCH), 0.05))
            .collect();
        let [right, wrong, _] = count(&run(&row, &second, &MatchParams::paper()));
        // Only the last stone has no second neighbour on the far side, so it passes beyond the limit.
        assert_eq!((right, wrong), (matches, 0), "shift of {share} pitches");
    }
}

#[test]
fn without_shifts_every_decision_follows_from_brute_force() {
    let params = MatchParams {
        max_shift_m: 0.0,
        shift_neighbours: 0,
        min_area_ratio: 0.93,
        max_ratio: 0.3,
        ..MatchParams::default()
    };
    let first = rubble(1);
    let second = moved(&first, 2, |p| Vector3::new(0.0, 0.03 + 0.004 * p.z, 0.02));
    let report = run(&first, &second, &params);
    let nearest = |from: &Point3<f64>, stones: &[Stone]| -> Vec<(f64, usize)> {
        let mut all: Vec<(f64, usize)> = (0..stones.len())
            .map(|j| ((stones[j].centroid - from).norm(), j))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all
    };
    let mut kinds = [0; 3];
    for (i, (id, outcome)) in report.outcomes.iter().enumerate() {
        let a = &first[i];
        assert_eq!(a.id, *id);
        let near = nearest(&a.centroid, &second);
        let b = &second[near[0].1];
        let size = a.area_m2.max(b.area_m2).sqrt();
        let area = a.area_m2.min(b.area_m2) / a.area_m2.max(b.area_m2);
        let expected = if near[0].0 > params.max_offset_sizes.unwrap() * size {
            MatchOutcome::Unmatched(UnmatchedReason::Lost)
        } else if area < params.min_area_ratio {
            kinds[0] += 1;
            MatchOutcome::Unmatched(UnmatchedReason::AreaMismatch)
        } else if near[0].0 / near[1].0 >= params.max_ratio || nearest(&b.centroid, &first)[0].1 != i {
            kinds[1] += 1;
            MatchOutcome::Unmatched(UnmatchedReason::Ambiguous)
        } else {
            kinds[2] += 1;
            MatchOutcome::Matched { second: b.id }
        };
        assert_eq!(*outcome, expected, "{id:?}");
    }
    assert!(kinds.iter().all(|k| *k > 5), "{kinds:?}");
}

#[test]
fn motions_of_no_a_half_and_two_pitches_match() {
    let first = rubble(3);
    for shift in [
        Vector3::zeros(),
        Vector3::new(0.05, -0.1, 0.12),
        Vector3::new(0.02, 2.0 * PITCH, 0.0),
        Vector3::new(0.0, -1.4 * PITCH, -1.6 * PITCH),
    ] {
        let report = run(&first, &moved(&first, 4, |_| shift), &MatchParams::default());
        let [right, wrong, _] = count(&report);
        assert!(
            right >= 795 && wrong == 0,
            "{shift:?}: {right} right, {wrong} wrong"
        );
        assert!(
            (report.common_shift - shift).norm() < 0.01,
            "{:?}",
            report.common_shift
        );
        assert!(report.local_shifts.iter().all(|s| (s - shift).norm() < 0.006));
    }
}

#[test]
fn settlement_bulge_and_loose_stones_match() {
    let first = rubble(5);
    let field = |p: &Point3<f64>| {
        let r = (p - Point3::new(0.0, 6.0, 3.0)).norm();
        let bulge = if r < 2.0 {
            0.15 * (std::f64::consts::FRAC_PI_4 * r).cos().powi(2)
        } else {
            0.0
        };
        let loose = if (p.y * 997.0).fract() < 0.03 { 0.03 } else { 0.0 };
        Vector3::new(bulge + loose, 0.02, -0.01 * p.y)
    };
    let [right, wrong, _] = count(&run(&first, &moved(&first, 6, field), &MatchParams::default()));
    assert!(right >= 790 && wrong == 0, "{right} right, {wrong} wrong");
}

#[test]
fn deleted_and_merged_stones_find_no_partner() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let first = rubble(8);
    let mut second = moved(&first, 9, |_| Vector3::new(0.01, 0.05, -0.08));
    let gone: Vec<u32> = (0..160).map(|_| rng.random_range(1001..1801)).collect();
    second.retain(|s| !gone.contains(&s.id.0));
    // Neighbours 10 and 11, 50 and 51, ... become one stone each.
    for id in (1010..1790).step_by(40) {
        let pair: Vec<Stone> = second
            .iter()
            .filter(|s| s.id.0 == id || s.id.0 == id + 1)
            .cloned()
            .collect();
        if let [a, b] = &pair[..] {
            let both = stone(
                id,
                nalgebra::center(&a.centroid, &b.centroid),
                a.area_m2 + b.area_m2,
            );
            second.retain(|s| s.id.0 != id && s.id.0 != id + 1);
            second.push(both);
        }
    }
    let covered = |p: &Point3<f64>| p.y < 6.0;
    let surroundings = Surroundings {
        covered: &covered,
        overlap: None,
    };
    let report = match_stones(&first, &second, &surroundings, &MatchParams::default());
    let [right, wrong, _] = count(&report);
    let kept = second.iter().filter(|s| s.id.0 < 1801).count();
    assert!(
        wrong <= 3 && right + 30 >= kept,
        "{right} right, {wrong} wrong of {kept}"
    );
    for (StoneId(a), outcome) in &report.outcomes {
        let here = first[*a as usize - 1].centroid.y;
        if gone.contains(&(a + 1000))
            && let MatchOutcome::Unmatched(reason) = outcome
        {
            let other = if here < 5.8 {
                UnmatchedReason::Unseen
            } else {
                UnmatchedReason::Lost
            };
            assert!((here - 6.0).abs() < 0.2 || *reason != other, "{a}: {reason:?}");
        }
    }
    let mut used: Vec<u32> = report
        .outcomes
        .iter()
        .filter_map(|o| {
            if let MatchOutcome::Matched { second } = o.1 {
                Some(second.0)
            } else {
                None
            }
        })
        .collect();
    let matched = used.len();
    used.extend(report.unmatched_second.iter().map(|s| s.0));
    used.sort_unstable();
    used.dedup();
    assert_eq!(used.len(), second.len(), "no stone is used twice or forgotten");
    assert_eq!(matched + report.unmatched_second.len(), second.len());
}

#[test]
fn the_order_of_the_tables_does_not_matter() {
    let (first, mut rng) = (rubble(10), ChaCha8Rng::seed_from_u64(11));
    let second = moved(&first, 12, |p| Vector3::new(0.0, 0.3, 0.01 * p.y));
    let report = run(&first, &second, &MatchParams::default());
    let (mut a, mut b) = (first, second);
    a.shuffle(&mut rng);
    b.shuffle(&mut rng);
    assert_eq!(run(&a, &b, &MatchParams::default()), report);
}

#[test]
fn an_overlap_decides_where_the_ratio_cannot() {
    // Two small stones beside each other, one of them off by half of their distance.
    let first = [
        stone(1, Point3::origin(), 0.04),
        stone(2, Point3::new(0.0, 0.12, 0.0), 0.04),
    ];
    let second = [
        stone(1001, Point3::new(0.0, 0.06, 0.0), 0.04),
        stone(1002, Point3::new(0.0, 0.13, 0.0), 0.04),
    ];
    let params = MatchParams {
        max_shift_m: 0.0,
        shift_neighbours: 0,
        ..MatchParams::default()
    };
    let outcome = |report: &MatchReport| report.outcomes[0].1;
    let ambiguous = MatchOutcome::Unmatched(UnmatchedReason::Ambiguous);
    assert_eq!(outcome(&run(&first, &second, &params)), ambiguous);
    let witness =
        |a: &Stone, b: &Stone, _: &Vector3<f64>| Some(if b.id.0 == a.id.0 + 1000 { 0.8 } else { 0.0 });
    let surroundings = Surroundings {
        covered: &|_| true,
        overlap: Some(&witness),
    };
    let report = match_stones(&first, &second, &surroundings, &params);
    assert_eq!(
        outcome(&report),
        MatchOutcome::Matched {
            second: StoneId(1001)
        }
    );
}

#[test]
fn empty_tables_give_empty_reports() {
    let stones = rubble(13);
    let none = run(&stones, &[], &MatchParams::default());
    assert!(
        none.outcomes
            .iter()
            .all(|o| o.1 == MatchOutcome::Unmatched(UnmatchedReason::Lost))
    );
    assert!(none.qualities.is_empty());
    assert_eq!(
        run(&[], &stones, &MatchParams::default()).unmatched_second.len(),
        800
    );
}
