//! The tree of a well-known text.

/// No system has parts inside parts to this depth.
const MAX_DEPTH: usize = 32;

/// One `KEYWORD[...]` of well-known text.
pub struct Node<'a> {
    pub keyword: &'a str,
    /// The whole of it.
    pub text: &'a str,
    /// Quoted texts and bare values, without the quotes.
    pub values: Vec<&'a str>,
    pub children: Vec<Node<'a>>,
}

impl<'a> Node<'a> {
    /// Reads a node and all below it; `None` where brackets or quotes do not match, or parts lie too deep.
    pub fn parse(text: &'a str) -> Option<Self> {
        let (node, rest) = Self::take(text, MAX_DEPTH)?;
        rest.trim().is_empty().then_some(node)
    }

    fn take(text: &'a str, depth: usize) -> Option<(Self, &'a str)> {
        let open = text.find(['[', '('])?;
        let mut node = Self {
            keyword: text[..open].trim(),
            text,
            values: Vec::new(),
            children: Vec::new(),
        };
        let mut rest = text[open + 1..].trim_start();

        loop {
            if let Some(quoted) = rest.strip_prefix('"') {
                let end = quoted.find('"')?;
                node.values.push(&quoted[..end]);
                rest = quoted[end + 1..].trim_start();
            } else {
                let end = rest.find([',', ']', ')', '[', '('])?;
                if rest[end..].starts_with(['[', '(']) {
                    let (child, after) = Self::take(rest, depth.checked_sub(1)?)?;
                    node.children.push(child);
                    rest = after.trim_start();
                } else {
                    node.values.push(rest[..end].trim());
                    rest = &rest[end..];
                }
            }
            if let Some(after) = rest.strip_prefix(',') {
                rest = after.trim_start();
            } else {
                let after = rest.strip_prefix([']', ')'])?;
                node.text = &text[..text.len() - after.len()];
                return Some((node, after));
            }
        }
    }

    /// The EPSG code of its own AUTHORITY (WKT 1) or ID (WKT 2).
    pub fn code(&self) -> Option<i32> {
        let own = |c: &&Node| matches!(c.keyword.to_ascii_uppercase().as_str(), "AUTHORITY" | "ID");
        let id = self.children.iter().find(own)?;
        let is_epsg = id.values.first().is_some_and(|v| v.eq_ignore_ascii_case("EPSG"));
        is_epsg.then(|| id.values.get(1)?.parse().ok()).flatten()
    }

    pub fn name(&self) -> Option<String> {
        self.values.first().map(|&v| v.to_owned())
    }

    /// The first child with one of these keywords.
    pub fn child(&self, keywords: &[&str]) -> Option<&Self> {
        let is_one = |c: &&Self| keywords.iter().any(|k| c.keyword.eq_ignore_ascii_case(k));
        self.children.iter().find(is_one)
    }

    /// Size of a unit.
    pub fn factor(&self) -> Option<f64> {
        let factor: f64 = self.values.get(1)?.parse().ok()?;
        Some(factor).filter(|f| f.is_finite() && *f > 0.0)
    }

    /// Whether it is a system of its own that is tied to the earth.
    pub fn is_crs(&self) -> bool {
        let keyword = self.keyword.to_ascii_uppercase();
        [
            "PROJCS",
            "PROJCRS",
            "PROJECTEDCRS",
            "GEOGCS",
            "GEOGCRS",
            "GEOGRAPHICCRS",
            "GEODCRS",
            "GEODETICCRS",
            "GEOCCS",
            "BOUNDCRS",
        ]
        .contains(&keyword.as_str())
    }

    /// Whether its axes are x, y and z (WKT 2).
    pub fn is_cartesian(&self) -> bool {
        let axes = self.child(&["CS"]).and_then(|cs| cs.values.first());
        axes.is_some_and(|kind| kind.eq_ignore_ascii_case("cartesian"))
    }

    /// The text with other texts for some children; an empty one takes the child away.
    pub fn edited(&self, edit: &dyn Fn(&Self) -> Option<String>) -> String {
        let mut out = String::new();
        let mut done = 0;
        for child in &self.children {
            let begin = child.text.as_ptr().addr() - self.text.as_ptr().addr();
            if let Some(new) = edit(child) {
                let before = &self.text[done..begin];
                out += match new.is_empty() {
                    true => before.trim_end().trim_end_matches(','),
                    false => before,
                };
                out += &new;
                done = begin + child.text.len();
            }
        }
        out + &self.text[done..]
    }
}
