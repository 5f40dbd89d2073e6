//! The embedded bundle of the report is what its sources in `web/` make.

const BUNDLE: &str = include_str!("../assets/report.js");
const STYLE: &str = include_str!("../assets/report.css");

#[test]
fn bundle_and_sources_agree() {
    stonewise_testing::assert_bundle(env!("CARGO_MANIFEST_DIR"), "report", &["src"], BUNDLE, STYLE);
}

#[test]
fn the_bundle_carries_the_licence_of_what_it_contains() {
    assert!(BUNDLE.contains("The MIT License") && BUNDLE.contains("three.js authors"));
    assert!(
        !BUNDLE.contains("</script"),
        "would end the element that holds it"
    );
}
