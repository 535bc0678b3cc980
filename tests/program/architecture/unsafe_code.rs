//! The places of unsafe code, held against the list in `.github/SECURITY.md`.

use std::collections::BTreeMap;

use syn::visit::{self, Visit};
use syn::{ExprUnsafe, ItemFn, ItemImpl};

/// The number of unsafe blocks, functions and implementations in a text of Rust.
pub(crate) fn count(text: &str) -> syn::Result<usize> {
    let mut counter = Counter(0);
    counter.visit_file(&syn::parse_file(text)?);
    Ok(counter.0)
}

/// The numbers in the rows of a page that begin with the path of a file in `src/`.
pub(crate) fn listed(page: &str) -> BTreeMap<String, usize> {
    page.lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix("| `src/")?.split('|');
            let path = cells.next()?.trim().strip_suffix('`')?;
            Some((path.to_owned(), cells.next()?.trim().parse().ok()?))
        })
        .collect()
}

struct Counter(usize);

impl Visit<'_> for Counter {
    fn visit_expr_unsafe(&mut self, block: &ExprUnsafe) {
        self.0 += 1;
        visit::visit_expr_unsafe(self, block);
    }

    fn visit_item_impl(&mut self, item: &ItemImpl) {
        self.0 += usize::from(item.unsafety.is_some());
        visit::visit_item_impl(self, item);
    }

    fn visit_item_fn(&mut self, item: &ItemFn) {
        self.0 += usize::from(matches!(item.sig.safety, syn::Safety::Unsafe(_)));
        visit::visit_item_fn(self, item);
    }
}

#[test]
fn blocks_functions_and_implementations_are_counted() {
    let text = "unsafe fn a() { unsafe { b() } } unsafe impl Send for A {} fn c() { (unsafe { d() }, 1); } impl A {}";
    assert_eq!(count(text).unwrap(), 4);
    let page = "| `src/a/b.rs` | 3 | why |\n| other | 1 |\n| `src/c.rs` | many |";
    assert_eq!(listed(page), BTreeMap::from([("a/b.rs".to_owned(), 3)]));
}
