//! How to read the figures, and what they do not say.

use super::html::section;

/// Method, definitions and limits of the statement.
pub(super) fn method() -> String {
    let body = "<p>Stones are outlined in the photos, their labels carried to the points of each epoch's cloud, stones matched across \
        epochs, and the rigid motion of every matched stone estimated from its points.</p>\
        <dl class=\"terms\">\
        <dt>Displacement</dt><dd>Second epoch minus first, of the stone's centroid in the first epoch.</dd>\
        <dt>Along, up, out</dt><dd>The stone's own face frame: horizontal in the face, to the right of a viewer who faces the wall; \
        up along the batter; out of the wall, towards the viewer.</dd>\
        <dt>Above its limit</dt><dd>d\u{2032}C<sup>\u{2212}1</sup>d exceeds 7.81, the 95 % quantile of chi-square with 3 degrees of \
        freedom; C is the covariance of the displacement, registration error included where it is known (see the datum check). A stone at \
        rest exceeds it in 5 % of the cases.</dd>\
        <dt>Moved</dt><dd>Above its limit, and still so when the share of false ones among all stones that are said to have moved is held at 5 % \
        (Benjamini &amp; Hochberg 1995). The verdict and the list of stones to look at count only these.</dd>\
        <dt>LoD95</dt><dd>The length beyond which a displacement of the same direction is above its limit.</dd>\
        <dt>Unlike its neighbours</dt><dd>The stone's motion differs from what its neighbours predict by more than noise explains; \
        false discoveries are controlled over all stones.</dd>\
        <dt>M3C2</dt><dd>Distance between the clouds along the local normal (Lague, Brodu &amp; Leroux 2013). It cannot see motion within \
        the face.</dd></dl>\
        <p>Limits of the statement: displacements refer to the registration of the epochs, so a motion common to many stones - \
        a shift, a tilt, a slow drift along the wall - may be an error of it, however small the limits of single stones are. A \
        stone is taken as rigid. Masks that merge or split stones spoil single rows; such pairs are reported as failed where they \
        can be told. Values of stones that were not measured are unknown, not zero.</p>";
    section("method", "Method, terms and limits", body)
}
