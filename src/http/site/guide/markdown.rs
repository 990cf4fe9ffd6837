//! The pages as Markdown, and the list of them for language models (llmstxt.org).

use std::collections::BTreeMap;

use pulldown_cmark::{Event, LinkType, Options, Parser, Tag, TagEnd};

use super::page::address;
use super::{GuidePage, PARTS};

/// The beginning of the list: the title, the summary, and what is no page.
const HEAD: &str = include_str!("llms_head.md");

/// Returns the text of a page with links that lead to the Markdown of other pages; it is made once and never freed.
pub fn made(document: &GuidePage) -> &'static str {
    let text = document.text;
    let mut links = BTreeMap::new();
    for (event, range) in Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter() {
        let (link, target) = match event {
            Event::Start(Tag::Link { link_type: LinkType::Inline, dest_url, .. }) => {
                let target = address(&dest_url, document.path, ".md");
                (dest_url, target)
            }
            Event::Start(Tag::Image { dest_url, .. }) => {
                let target = format!("/guide/{}", dest_url.rsplit('/').next().unwrap_or_default());
                (dest_url, target)
            }
            _ => continue,
        };
        if let Some(at) = text[range.clone()].rfind(&format!("]({link}")) {
            links.insert(range.start + at + 2, (link.len(), target));
        }
    }
    let (mut page, mut done) = (String::with_capacity(text.len()), 0);
    for (at, (length, target)) in links {
        page.push_str(&text[done..at]);
        page.push_str(&target);
        done = at + length;
    }
    page.push_str(&text[done..]);
    page.leak()
}

/// Returns the list of all pages by part, each with its first sentence.
pub fn list() -> String {
    let mut list = HEAD.to_owned();
    for (part, documents) in PARTS {
        list.push_str(&format!("\n## {part}\n\n"));
        for document in *documents {
            let GuidePage { name, title, text, .. } = document;
            list.push_str(&format!("- [{title}](/guide/{name}.md): {}\n", first_sentence(text)));
        }
    }
    list
}

/// Returns the first sentence of the first paragraph, without its markup.
fn first_sentence(text: &str) -> String {
    let events = Parser::new(text).skip_while(|event| !matches!(event, Event::Start(Tag::Paragraph)));
    let paragraph = events.take_while(|event| !matches!(event, Event::End(TagEnd::Paragraph)));
    let words: String = paragraph
        .filter_map(|event| match event {
            Event::Text(text) | Event::Code(text) => Some(text.into_string()),
            Event::SoftBreak => Some(" ".to_owned()),
            _ => None,
        })
        .collect();
    match words.split_once(". ") {
        Some((first, _)) => format!("{first}."),
        None => words.trim_end_matches(':').to_owned(),
    }
}
