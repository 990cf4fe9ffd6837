//! Elements of HTML and SVG as a tree, written as text that an XML parser accepts too.

use std::fmt::Display;

/// Elements that never hold anything.
const VOID: [&str; 5] = ["meta", "path", "line", "rect", "circle"];

#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Node>,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Element(Element),
    Text(String),
    Style(&'static str),
}

impl Element {
    pub fn new(name: &'static str) -> Self {
        Element { name, attributes: Vec::new(), children: Vec::new() }
    }

    pub fn with(mut self, attribute: &'static str, value: impl Display) -> Self {
        self.attributes.push((attribute, value.to_string()));
        self
    }

    /// A coordinate or length, to a hundredth of a unit.
    pub fn at(self, attribute: &'static str, value: f64) -> Self {
        self.with(attribute, format_args!("{value:.2}"))
    }

    pub fn class(self, names: impl Display) -> Self {
        self.with("class", names)
    }

    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.children.push(Node::Text(text.into()));
        self
    }

    pub fn child(mut self, child: Element) -> Self {
        self.children.push(Node::Element(child));
        self
    }

    pub fn children(mut self, children: impl IntoIterator<Item = Element>) -> Self {
        self.children.extend(children.into_iter().map(Node::Element));
        self
    }

    /// A `<style>`, whose text browsers read as it is: it must hold none of `<`, `&` and `]]>`.
    pub fn style(sheet: &'static str) -> Self {
        Element { name: "style", attributes: Vec::new(), children: vec![Node::Style(sheet)] }
    }

    pub fn write(&self, out: &mut String) {
        out.push('<');
        out.push_str(self.name);
        for (name, value) in &self.attributes {
            out.push(' ');
            out.push_str(name);
            out.push_str("=\"");
            escape(value, out);
            out.push('"');
        }
        if VOID.contains(&self.name) {
            return out.push_str("/>");
        }
        out.push('>');
        for child in &self.children {
            match child {
                Node::Element(element) => element.write(out),
                Node::Text(text) => escape(text, out),
                Node::Style(sheet) => out.push_str(sheet),
            }
        }
        out.push_str("</");
        out.push_str(self.name);
        out.push('>');
    }
}

/// Letters that mean something in markup, and those XML does not allow at all.
fn escape(text: &str, out: &mut String) {
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(letter),
            '\u{FFFE}' | '\u{FFFF}' => out.push('\u{FFFD}'),
            letter if letter.is_control() => out.push('\u{FFFD}'),
            letter => out.push(letter),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_attributes_are_escaped() {
        let mut out = String::new();
        Element::new("p")
            .with("title", "a\"b'c")
            .text("1 < 2 & \u{0} 3 > 2")
            .child(Element::new("line"))
            .write(&mut out);
        assert_eq!(out, "<p title=\"a&quot;b&#39;c\">1 &lt; 2 &amp; \u{FFFD} 3 &gt; 2<line/></p>");
    }
}
