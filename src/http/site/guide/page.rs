//! Renders a document as a page: its Markdown as HTML, the list of all pages beside it, and links that lead where they
//! lead in the repository.

use pulldown_cmark::html::push_html;
use pulldown_cmark::{CowStr, Event, HeadingLevel, Options, Parser, Tag, TagEnd};

use super::{GuidePage, PARTS, documents};

/// Returns the whole page; it is made once and never freed.
pub fn made(document: &GuidePage) -> &'static [u8] {
    let mut events: Vec<Event> = Parser::new_ext(document.text, Options::ENABLE_TABLES).collect();
    let headings = named(&mut events);
    let mut body = String::new();
    push_html(&mut body, events.into_iter().filter_map(|event| led(event, document)));
    // Wide tables scroll by themselves, also with the keyboard.
    let body = body
        .replace("<table>", "<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"Table\"><table>")
        .replace("</table>", "</table></div>")
        .replace("<pre>", "<pre tabindex=\"0\">");
    let title = document.title;
    let page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
        <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
        <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title} \u{b7} Ballast</title>\n\
        <link rel=\"alternate\" type=\"text/markdown\" href=\"/guide/{}.md\">\n\
        <link rel=\"icon\" type=\"image/svg+xml\" href=\"/dashboard/icon.svg\">\n\
        <link rel=\"stylesheet\" href=\"/dashboard/style.css\">\n<link rel=\"stylesheet\" href=\"/guide/guide.css\">\n\
        </head>\n<body>\n<a class=\"skip\" href=\"#main\">Skip to the content</a>\n<header class=\"bar\">\n\
        <a class=\"mark\" href=\"/\"><img src=\"/dashboard/icon.svg\" alt=\"\" width=\"24\" height=\"24\">Ballast</a>\n\
        <a class=\"docs\" href=\"/\">Overview</a>\n<a href=\"/docs\">API</a>\n</header>\n\
        <div class=\"guide\">\n{}<main id=\"main\" tabindex=\"-1\">\n{body}</main>\n</div>\n</body>\n</html>\n",
        document.name,
        list(document, &headings)
    );
    page.leak().as_bytes()
}

/// A heading of the second level: its text and its anchor.
struct Heading {
    text: String,
    anchor: String,
}

/// Gives every heading the anchor that repositories give it, and returns those of the second level.
fn named(events: &mut [Event]) -> Vec<Heading> {
    let mut headings = Vec::new();
    for start in 0..events.len() {
        let Event::Start(Tag::Heading { level, .. }) = events[start] else { continue };
        let inside = events[start + 1..].iter().take_while(|event| !matches!(event, Event::End(TagEnd::Heading(_))));
        let text: String = inside
            .filter_map(|event| match event {
                Event::Text(text) | Event::Code(text) => Some(&**text),
                _ => None,
            })
            .collect();
        let anchor = anchor(&text);
        if let Event::Start(Tag::Heading { id, .. }) = &mut events[start] {
            *id = Some(CowStr::from(anchor.clone()));
        }
        if level == HeadingLevel::H2 {
            headings.push(Heading { text, anchor });
        }
    }
    headings
}

fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase().replace(' ', "-");
    kept.chars().filter(|letter| letter.is_alphanumeric() || matches!(letter, '-' | '_')).collect()
}

/// Rewrites links and pictures of the repository to the addresses at which they are served. Tags within a text are
/// shown, not treated as markup.
fn led<'a>(event: Event<'a>, document: &GuidePage) -> Option<Event<'a>> {
    Some(match event {
        Event::Html(text) | Event::InlineHtml(text) => Event::Text(text),
        Event::Start(Tag::Link { link_type, dest_url, title, id }) => {
            let dest_url = address(&dest_url, document.path, "").into();
            Event::Start(Tag::Link { link_type, dest_url, title, id })
        }
        Event::Start(Tag::Image { link_type, dest_url, title, id }) => {
            let name = dest_url.rsplit('/').next().unwrap_or_default();
            Event::Start(Tag::Image { link_type, dest_url: format!("/guide/{name}").into(), title, id })
        }
        event => event,
    })
}

/// Returns the address to which a link in the document at `from` leads, for pages whose names end with `ending`. A link
/// to anything but a page stays unchanged.
///
/// Checked by: `every_link_of_every_page_leads_to_what_is_served`, `every_link_of_the_list_leads_to_markdown`.
pub(super) fn address(link: &str, from: &str, ending: &str) -> String {
    if link.starts_with('#') || link.contains("://") {
        return link.to_owned();
    }
    let (path, at) = link.split_once('#').map_or((link, String::new()), |(path, at)| (path, format!("#{at}")));
    let mut folders: Vec<&str> = from.split('/').collect();
    folders.pop();
    for part in path.split('/') {
        match part {
            ".." => drop(folders.pop()),
            part => folders.push(part),
        }
    }
    let path = folders.join("/");
    let target = documents().find(|document| document.path == path);
    target.map_or_else(|| link.to_owned(), |document| format!("/guide/{}{ending}{at}", document.name))
}

/// Renders the list of all pages by part, with the headings below the current one.
fn list(shown: &GuidePage, headings: &[Heading]) -> String {
    let mut list = String::from("<nav class=\"pages\" aria-label=\"Pages of the guide\">\n");
    for (part, documents) in PARTS {
        list.push_str(&format!("<p>{part}</p>\n<ul>\n"));
        for GuidePage { name, title, .. } in *documents {
            if *name != shown.name {
                list.push_str(&format!("<li><a href=\"/guide/{name}\">{title}</a></li>\n"));
                continue;
            }
            list.push_str(&format!("<li><a href=\"/guide/{name}\" aria-current=\"page\">{title}</a>\n<ul>\n"));
            for Heading { text, anchor } in headings {
                let text = text.replace('&', "&amp;").replace('<', "&lt;");
                list.push_str(&format!("<li><a href=\"#{anchor}\">{text}</a></li>\n"));
            }
            list.push_str("</ul>\n</li>\n");
        }
        list.push_str("</ul>\n");
    }
    list + "</nav>\n"
}
