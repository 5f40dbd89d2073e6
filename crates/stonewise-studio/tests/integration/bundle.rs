//! The embedded bundle of the page is what its sources in `web/` make.

#[test]
fn bundle_and_sources_agree() {
    let (script, style) = (
        include_str!("../../assets/studio.js"),
        include_str!("../../assets/studio.css"),
    );
    stonewise_testing::assert_bundle(
        env!("CARGO_MANIFEST_DIR"),
        "studio",
        &["src", "studio"],
        script,
        style,
    );
}
