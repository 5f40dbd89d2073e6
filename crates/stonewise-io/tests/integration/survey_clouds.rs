//! Clouds of the surveys, where they are at hand.

use crate::cloud_formats::labels_by_index;
use std::time::Instant;
use stonewise_testing::survey;

use stonewise_core::geometry::Bounds;
use stonewise_io::cloud::{CloudError, LabelColumns, cloud_info, read_cloud, write_labelled};

#[test]
fn counts_and_bounds_agree_with_the_headers() {
    for (name, count) in [
        ("fountain/epoch1/cloud.laz", 2_748_762),
        ("dam_small/split/epoch1/cloud_uav.laz", 89_914),
    ] {
        let Some(path) = survey(name) else { return };
        let info = cloud_info(&path).unwrap();
        assert_eq!(info.records, count);
        let mut bounds: Option<Bounds> = None;
        let mut next = 0;
        let summary = read_cloud(&path, 400_000, |chunk| {
            assert_eq!(chunk.indices[0], next);
            next += chunk.len() as u64;
            assert_eq!(chunk.colors.as_ref().map(Vec::len), Some(chunk.len()));
            let new = Bounds::of(chunk.positions.iter().copied()).unwrap();
            bounds = Some(bounds.map_or(new, |b| b.union(&new)));
            Ok::<(), CloudError>(())
        })
        .unwrap();
        assert_eq!((summary.records, summary.skipped), (count, 0));
        let (read, stated) = (bounds.unwrap(), info.bounds.unwrap());
        assert!((read.min - stated.min).amax() < 1e-9);
        assert!((read.max - stated.max).amax() < 1e-9);
    }
}

#[test]
fn a_labelled_copy_keeps_every_attribute() {
    let Some(path) = survey("dam_small/split/epoch1/cloud_uav.laz") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("labelled.laz");
    let started = Instant::now();
    let summary = write_labelled(&path, &out, LabelColumns::StoneAndMotion, labels_by_index).unwrap();
    let rate = summary.records as f64 / started.elapsed().as_secs_f64();
    println!("labelled copy: {:.2} million points/s", rate / 1e6);

    let mut before = las::Reader::from_path(&path).unwrap();
    let mut after = las::Reader::from_path(&out).unwrap();
    assert_eq!(
        after.header().number_of_points(),
        before.header().number_of_points()
    );
    assert_eq!(after.header().bounds(), before.header().bounds());
    assert_eq!(after.header().transforms(), before.header().transforms());
    let mut first = 0;
    loop {
        let (a, b) = (
            before.read_points(100_000).unwrap(),
            after.read_points(100_000).unwrap(),
        );
        if a.is_empty() {
            break;
        }
        let (m, n) = (a.record_len(), b.record_len());
        assert_eq!(n, m + 18);
        for i in 0..a.len() {
            let record = &b.raw_bytes()[i * n..(i + 1) * n];
            assert_eq!(&record[..m], &a.raw_bytes()[i * m..(i + 1) * m]);
            let index = first + i as u32;
            let id = u32::from_le_bytes(record[m..m + 4].try_into().unwrap());
            assert_eq!(id, if index.is_multiple_of(3) { 0 } else { index });
            let dx = f32::from_le_bytes(record[m + 4..m + 8].try_into().unwrap());
            assert!(if index % 3 == 2 {
                dx == index as f32
            } else {
                dx.is_nan()
            });
        }
        first += a.len() as u32;
    }
}
