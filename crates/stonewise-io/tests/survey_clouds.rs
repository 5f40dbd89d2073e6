//! Clouds of the surveys, where they are at hand.

use std::path::{Path, PathBuf};

use stonewise_core::geometry::Bounds;
use stonewise_io::cloud::{CloudError, cloud_info, read_cloud};

fn survey(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {name} is not at hand");
    None
}

#[test]
fn counts_and_bounds_agree_with_the_headers() {
    for (name, count) in [
        ("fountain/epoch1/cloud.laz", 2_748_762),
        ("fountain/epoch2/cloud.laz", 2_464_565),
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
