//! The embedded bundles of the report and the studio are what their sources in `web/` make.
//!
//! The first line of a bundle holds two digests, of all sources and of the bundle itself; `web/build.mjs` writes them.
//! Both are computed again here, so that no node is needed to see a source that was changed without a build, or a
//! bundle that was changed by hand.

use std::path::{Path, PathBuf};

/// FNV-1a, 64 bits (Fowler, Noll & Vo).
fn digest(parts: &[Vec<u8>]) -> String {
    let hash = parts
        .iter()
        .flatten()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
        });
    format!("{hash:016x}")
}

/// Files of a folder and below.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|e| e.path());
    entries
        .flat_map(|p| if p.is_dir() { files(&p) } else { vec![p] })
        .collect()
}

const REPORT: &str = include_str!("../../../stonewise-report/assets/report.js");
const REPORT_STYLE: &str = include_str!("../../../stonewise-report/assets/report.css");
const STUDIO: &str = include_str!("../../../stonewise-studio/assets/studio.js");
const STUDIO_STYLE: &str = include_str!("../../../stonewise-studio/assets/studio.css");

/// Asserts that a bundle is what the sources in these folders of `web/` make.
fn assert_bundle(name: &str, folders: &[&str], script: &str, style: &str) {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web");
    if !web.exists() {
        println!("skipped: the sources of the bundle are not here");
        return;
    }
    let inside = |p: &Path| p.strip_prefix(&web).unwrap().to_str().unwrap().replace('\\', "/");
    let all = folders.iter().flat_map(|folder| files(&web.join(folder)));
    let mut paths: Vec<String> = all.map(|p| inside(&p)).collect();
    paths.extend(["build.mjs", "package-lock.json", "package.json", "tsconfig.json"].map(str::to_owned));
    paths.sort();
    let parts: Vec<Vec<u8>> = paths
        .iter()
        .flat_map(|p| [p.clone().into_bytes(), std::fs::read(web.join(p)).unwrap()])
        .collect();
    let (head, rest) = script.split_once('\n').unwrap();
    let built = digest(&[rest.as_bytes().to_vec(), style.as_bytes().to_vec()]);
    let expected = format!(
        "/* stonewise {name}; sources {}, bundle {built} */",
        digest(&parts)
    );
    assert_eq!(
        head, expected,
        "run `npm ci && npm run build` in web/ and commit the assets of the crates"
    );
}

#[test]
fn bundles_and_sources_agree() {
    assert_bundle("report", &["src"], REPORT, REPORT_STYLE);
    assert_bundle("studio", &["src", "studio"], STUDIO, STUDIO_STYLE);
}

#[test]
fn the_bundle_of_the_report_carries_the_licence_of_what_it_contains() {
    assert!(REPORT.contains("The MIT License") && REPORT.contains("three.js authors"));
    assert!(
        !REPORT.contains("</script"),
        "would end the element that holds it"
    );
}

#[test]
fn fnv_is_the_published_function() {
    // Test vectors of the authors: "" and "foobar".
    assert_eq!(digest(&[]), "cbf29ce484222325");
    assert_eq!(digest(&[b"foobar".to_vec()]), "85944171f73967e8");
}
