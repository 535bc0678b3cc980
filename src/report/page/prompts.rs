//! Prompts of the items for the page's script: [`PagePrompts`]. Each distinct form is stored once; the script fills in
//! the question and its choices.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;

use darkqa_ask::prompts::Prompts;
use darkqa_base::types::View;

/// Prompts of one or more runs, with the texts around the questions.
#[derive(Debug)]
pub struct RunPrompts {
    /// Templates of all runs.
    pub templates: Prompts,
    /// True if the image precedes the text.
    pub image_first: bool,
    /// Models at endpoints, each with its system message.
    pub models: BTreeMap<String, Option<String>>,
}

/// Prompts for the script.
#[derive(Clone, Serialize)]
pub(crate) struct PagePrompts {
    /// Distinct prompts, the first one empty, with marks in place of the question and its choices: the characters from
    /// [`QUESTION`] and [`CHOICES`] on.
    pub forms: Vec<String>,
    /// Indices into `forms` for each item: with and without its image; 0 if the prompt is not known.
    pub items: Vec<[usize; 2]>,
    /// True if the image precedes the text.
    pub image_first: bool,
    /// Models at endpoints, each with its system message.
    pub models: BTreeMap<String, Option<String>>,
}

/// Mark of the question, a character of the private use area.
const QUESTION: char = '\u{e000}';

/// Mark of the first choice; the marks of the others follow.
const CHOICES: char = '\u{e001}';

/// First character after the marks: a question has at most 26 choices.
const END: char = '\u{e01b}';

impl PagePrompts {
    /// The prompts of items, each given by the texts of its question and choices. An item without a text has none.
    pub(crate) fn new<'i>(prompts: &RunPrompts, items: impl Iterator<Item = (&'i str, &'i [String])>) -> Self {
        let mut forms = vec![String::new()];
        let mut indices = HashMap::from([(String::new(), 0)]);
        let mut known = HashMap::new();
        let items = items
            .map(|(question, choices)| {
                [View::Image, View::Blind].map(|view| {
                    let form = known
                        .entry((choices.len(), view == View::Blind))
                        .or_insert_with(|| form(&prompts.templates, view, choices.len()));
                    let prompt = prompt(&prompts.templates, view, form.as_deref(), question, choices);
                    *indices.entry(prompt).or_insert_with_key(|prompt| {
                        forms.push(prompt.clone());
                        forms.len() - 1
                    })
                })
            })
            .collect();
        Self { forms, items, image_first: prompts.image_first, models: prompts.models.clone() }
    }
}

/// The prompt with marks for a number of choices; `None` if the template fails with marks.
fn form(templates: &Prompts, view: View, choices: usize) -> Option<String> {
    let marks: Vec<String> = (CHOICES..END).take(choices).map(String::from).collect();
    templates.render_texts(view, &QUESTION.to_string(), &marks).ok()
}

/// The form of a prompt if the script can fill it in, else the prompt itself; empty if it is not known.
fn prompt(templates: &Prompts, view: View, form: Option<&str>, question: &str, choices: &[String]) -> String {
    if question.is_empty() {
        return String::new();
    }
    let Ok(sent) = templates.render_texts(view, question, choices) else {
        return String::new();
    };
    match form {
        Some(form) if fill(form, question, choices) == sent => form.to_owned(),
        _ if sent.contains(|c| (QUESTION..END).contains(&c)) => String::new(),
        _ => sent,
    }
}

/// Fills in a form as the script does.
fn fill(form: &str, question: &str, choices: &[String]) -> String {
    let mut text = String::new();
    for c in form.chars() {
        let choice = (c as usize).checked_sub(CHOICES as usize).and_then(|index| choices.get(index));
        match choice {
            _ if c == QUESTION => text += question,
            Some(choice) => text += choice,
            None => text.push(c),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page_prompts(choice: &str, items: &[(&str, &[&str])]) -> PagePrompts {
        let stored = serde_json::json!({"choice": choice, "blind": "{{ question }}{% for c in choices %} {{ c.text }}{% endfor %}"});
        let digest = darkqa_base::types::Digest::from_parts(
            ["choice", "blind"].map(|name| stored[name].as_str().unwrap().as_bytes()),
        );
        let templates = Prompts::from_stored(&digest.to_string(), Some(&stored)).unwrap();
        let prompts = RunPrompts { templates, image_first: false, models: BTreeMap::new() };
        let items: Vec<(&str, Vec<String>)> = items
            .iter()
            .map(|(question, choices)| (*question, choices.iter().map(|&c| c.to_owned()).collect()))
            .collect();
        PagePrompts::new(&prompts, items.iter().map(|(question, choices)| (*question, &**choices)))
    }

    #[test]
    fn items_share_a_form_for_each_number_of_choices() {
        let template = "Look. {{ question }}{% for c in choices %}\n{{ c.letter }}. {{ c.text }}{% endfor %}";
        let items: [(&str, &[&str]); 4] =
            [("One?", &["yes", "no"]), ("Two?", &["no", "yes"]), ("Three?", &["a", "b", "Two?"]), ("", &["yes", "no"])];
        let page = page_prompts(template, &items);
        assert_eq!(page.items, [[1, 2], [1, 2], [3, 4], [0, 0]]);
        assert_eq!(page.forms[1], "Look. \u{e000}\nA. \u{e001}\nB. \u{e002}");
        assert_eq!(page.forms[3], "Look. \u{e000}\nA. \u{e001}\nB. \u{e002}\nC. \u{e003}");
    }

    #[test]
    fn a_prompt_that_depends_on_its_texts_is_kept_whole() {
        let template = "{{ question }}{% for c in choices %} {{ c.text }}{% endfor %}{% if question == 'Two?' %} Think.{% endif %}";
        let page = page_prompts(
            template,
            &[("One?", &["yes", "no"]), ("Two?", &["yes", "no"]), ("\u{e001}?", &["yes", "no"])],
        );
        // Both views have the same words here, and share a form.
        assert_eq!(page.items, [[1, 1], [2, 1], [1, 1]]);
        assert_eq!(page.forms[2], "Two? yes no Think.");
    }
}
