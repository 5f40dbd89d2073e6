//! XML: elements of a document that is read, and text for one that is written.

use roxmltree::{Document, Error, Node};

/// Why a document is no XML.
#[derive(Debug)]
pub(crate) struct XmlError {
    /// Line, counted from 1.
    pub line: u32,
    /// What is wrong.
    pub problem: String,
}

/// Parses a document. Document types are refused, and with them entities other than those of XML itself.
///
/// Names and values are pieces of the text; the tree takes up to five times its size in memory.
pub(crate) fn parse(text: &str) -> Result<Document<'_>, XmlError> {
    Document::parse(text).map_err(|error| match error {
        Error::NoRootNode => XmlError {
            line: 1,
            problem: "no xml element".to_owned(),
        },
        Error::UnclosedRootNode | Error::UnexpectedEndOfStream => XmlError {
            line: text.lines().count().try_into().unwrap_or(u32::MAX),
            problem: "broken xml (it ends inside an element): is the file complete?".to_owned(),
        },
        error => XmlError {
            line: error.pos().row,
            problem: format!("broken xml ({error})"),
        },
    })
}

/// An element with its attributes and what it holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element<'a>(Node<'a, 'a>);

impl<'a> Element<'a> {
    /// The outermost element of a document.
    pub fn root(document: &'a Document<'a>) -> Self {
        Self(document.root_element())
    }

    /// Its name without the prefix.
    pub fn name(self) -> &'a str {
        self.0.tag_name().name()
    }

    /// The value of an attribute, in any namespace.
    pub fn attribute(self, name: &str) -> Option<&'a str> {
        self.0.attribute(name)
    }

    /// The value of an attribute, else the text of a child, of this name in a namespace that begins like this.
    pub fn value_in(self, namespace: &str, name: &str) -> Option<String> {
        let is_in = |found: Option<&str>| found.is_some_and(|n| n.starts_with(namespace));
        let mut attributes = self.0.attributes();
        let attribute = attributes.find(|a| a.name() == name && is_in(a.namespace()));
        let child = || self.all(name).find(|child| is_in(child.0.tag_name().namespace()));
        attribute
            .map(|a| a.value().to_owned())
            .or_else(|| child().map(Self::text))
    }

    /// The elements directly in it.
    pub fn children(self) -> impl Iterator<Item = Self> {
        self.0.children().filter(Node::is_element).map(Self)
    }

    /// Those of its children that have a name, in any namespace.
    pub fn all(self, name: &str) -> impl Iterator<Item = Self> {
        self.children().filter(move |child| child.name() == name)
    }

    /// The first of its children that has a name.
    pub fn child(self, name: &str) -> Option<Self> {
        self.all(name).next()
    }

    /// The elements of a name at any depth in it, in their order.
    pub fn below(self, name: &str) -> impl Iterator<Item = Self> {
        self.0
            .descendants()
            .filter(move |node| node.has_tag_name(name))
            .map(Self)
    }

    /// The text directly in it.
    pub fn text(self) -> String {
        self.0
            .children()
            .filter(Node::is_text)
            .filter_map(|node| node.text())
            .collect()
    }

    /// Its line, counted from 1.
    pub fn line(self) -> usize {
        self.0.document().text_pos_at(self.0.range().start).row as usize
    }

    /// "<name> in line n".
    pub fn place(self) -> String {
        format!("<{}> in line {}", self.name(), self.line())
    }
}

/// Text as it stands in an element or in the value of an attribute.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escaped_text_reads_back_in_elements_and_attributes() {
        let text = "a < b & \"c\" > 'd' &amp; \u{e4}";
        let document = format!("<e a=\"{0}\" b='{0}'>{0}</e>", escape(text));
        let document = parse(&document).unwrap();
        let element = Element::root(&document);
        assert_eq!([element.attribute("a"), element.attribute("b")], [Some(text); 2]);
        assert_eq!(element.text(), text);
    }

    #[test]
    fn text_is_whole_around_comments_and_elements() {
        let document = parse("<!-- 0 --><a>1 <!-- 2 -->3<b>4</b> <![CDATA[<5>]]>&#54;</a>").unwrap();
        let root = Element::root(&document);
        assert_eq!(root.text(), "1 3 <5>6");
        assert_eq!(root.child("b").unwrap().text(), "4");
    }

    #[test]
    fn names_may_be_of_a_namespace() {
        let document =
            parse("<a xmlns:n='urn:n/2' xmlns:m='urn:m' m:c='1' n:c='2'><m:d>3</m:d><n:d>4</n:d></a>")
                .unwrap();
        let root = Element::root(&document);
        assert_eq!(root.value_in("urn:n/", "c").as_deref(), Some("2"));
        assert_eq!(root.value_in("urn:n/", "d").as_deref(), Some("4"));
        assert_eq!(root.value_in("urn:n/", "e"), None);
        assert_eq!(root.attribute("c"), Some("1"));
        assert_eq!(root.child("d").unwrap().text(), "3");
    }

    #[test]
    fn broken_documents_are_refused_with_their_line() {
        for (text, line, problem) in [
            ("", 1, "no xml element"),
            ("<a>\n<b>\n</a>\n</b>", 3, "broken xml"),
            ("<a>\n<b>\n", 2, "is the file complete?"),
            ("<a>\n<b c=\"", 2, "is the file complete?"),
            ("<a>\n&own;</a>", 2, "own"),
            ("<a b='1'\n b='2'/>", 2, "'b'"),
            ("<a>\n\u{1}</a>", 2, "non-XML character"),
            // Entities that grow, and one that is a file.
            (
                "<!DOCTYPE a [<!ENTITY b \"bb\"><!ENTITY c \"&b;&b;\">]><a>&c;</a>",
                1,
                "DTD",
            ),
            (
                "<!DOCTYPE a [<!ENTITY b SYSTEM \"file:///etc/passwd\">]><a>&b;</a>",
                1,
                "DTD",
            ),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.problem.contains(problem), "{text:?}: {error:?}");
            assert_eq!(error.line, line, "{text:?}: {error:?}");
        }
    }
}
