//! One file of Rust, and what stands in it.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use proc_macro2::{Delimiter, Ident, Spacing, Span, TokenStream, TokenTree};
use syn::ext::IdentExt as _;
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, LitStr, Meta, Token, UseTree};

/// Facts about one file that the rules use.
pub(crate) struct Source {
    /// Its path in `src/`.
    pub(crate) path: String,
    /// Its place as a module, from the crate's root.
    pub(crate) module: Vec<String>,
    /// The number of its lines of code: those with more than comments, outside of modules for tests.
    pub(crate) code_lines: usize,
    /// Its parts, in their order.
    pub(crate) parts: Vec<Part>,
    /// Whether it is for tests alone.
    pub(crate) is_test: bool,
}

/// A part of a file that a rule asks about.
pub(crate) struct Part {
    pub(crate) kind: Kind,
    /// The names of its path, without a leading `::`; of a text the text.
    pub(crate) names: Vec<String>,
    /// The module in which it stands, from the crate's root.
    pub(crate) scope: Vec<String>,
    /// Its line, from 1.
    pub(crate) line: usize,
    /// Whether it is in a module for tests.
    pub(crate) in_test: bool,
}

/// Kind of a part.
pub(crate) enum Kind {
    /// A path in an expression, a type, a pattern, an attribute or the tokens of a macro. A path of one name is here if
    /// it is the name of a type, of a constant or of a function that is called.
    Path,
    /// The path of a macro that is called.
    Macro,
    /// A path of a `use`, and the name that it brings in. A path that ends with `*` brings in all names, and none here.
    Import { name: String, is_export: bool },
    /// An `.await`.
    Await,
    /// A text; those of attributes are left out.
    Text,
    /// The beginning of a function or of a `macro_rules!`.
    Function,
    /// The declaration of a module for tests, which is a file of its own.
    TestFile,
}

impl Source {
    /// The file at a path in `src/`, or why its text is not Rust.
    pub(crate) fn read(path: &str, text: &str) -> syn::Result<Self> {
        let module = path.strip_suffix(".rs").unwrap_or(path);
        let module = module.strip_suffix("/mod").unwrap_or(module);
        let module: Vec<String> = module.split('/').filter(|name| *name != "lib").map(str::to_owned).collect();
        let mut reader = Reader { scope: module.clone(), parts: Vec::new(), in_test: false, in_attribute: false };
        let file = syn::parse_file(text)?;
        reader.visit_file(&file);
        let code_lines = code_lines(&file, text.parse()?);
        Ok(Self { path: path.to_owned(), module, code_lines, parts: reader.parts, is_test: false })
    }

    /// The path behind a name that a `use` at the top of the file brings in.
    pub(crate) fn imported(&self, wanted: &str) -> Option<&[String]> {
        let brings = |part: &&Part| {
            let is_it = matches!(&part.kind, Kind::Import { name, .. } if name == wanted);
            is_it && part.scope == self.module
        };
        let found = self.parts.iter().find(brings);
        found.map(|part| part.names.as_slice())
    }
}

impl Part {
    /// Whether it is a path.
    pub(crate) fn is_path(&self) -> bool {
        matches!(self.kind, Kind::Path | Kind::Macro | Kind::Import { .. })
    }
}

/// A walk through the syntax tree of a file.
struct Reader {
    parts: Vec<Part>,
    scope: Vec<String>,
    in_test: bool,
    in_attribute: bool,
}

impl Reader {
    fn add(&mut self, kind: Kind, names: &[Ident]) {
        if let Some(last) = names.last() {
            self.add_at(kind, names.iter().map(plain).collect(), last.span());
        }
    }

    fn add_at(&mut self, kind: Kind, names: Vec<String>, at: Span) {
        self.parts.push(Part { kind, names, scope: self.scope.clone(), line: at.start().line, in_test: self.in_test });
    }

    /// Reads the tokens of a macro, which have no syntax tree. In `a::{b, c}`, each path begins with what stands
    /// `before`.
    fn tokens(&mut self, tokens: &TokenStream, before: &[Ident]) {
        let joined = if before.is_empty() { "" } else { "::" };
        // The path that the last tokens make, and the signs after it.
        let (mut path, mut signs) = (before.to_vec(), joined.to_owned());
        for token in tokens.clone() {
            match token {
                TokenTree::Ident(name) if signs == "::" => {
                    path.push(name);
                    signs.clear();
                }
                TokenTree::Ident(name) => {
                    self.end(&path, &signs);
                    let is_member = signs.ends_with('.') && !signs.ends_with("..");
                    if is_member && name == "await" {
                        self.add(Kind::Await, std::slice::from_ref(&name));
                    }
                    path = if is_member { Vec::new() } else { vec![name] };
                    signs.clear();
                }
                TokenTree::Punct(sign) if sign.as_char() == ',' => {
                    self.end(&path, &signs);
                    (path, signs) = (before.to_vec(), joined.to_owned());
                }
                TokenTree::Punct(sign) => {
                    signs.push(sign.as_char());
                    if signs == "!" && sign.spacing() == Spacing::Alone {
                        self.add(Kind::Macro, &std::mem::take(&mut path));
                    }
                }
                TokenTree::Group(group) => {
                    let is_tree = signs == "::" && group.delimiter() == Delimiter::Brace;
                    let is_call = signs.is_empty() && group.delimiter() == Delimiter::Parenthesis;
                    self.end(&path, if is_call { "(" } else { &signs });
                    self.tokens(&group.stream(), if is_tree { &path } else { &[] });
                    path.clear();
                    signs.clear();
                }
                TokenTree::Literal(literal) => {
                    self.end(&path, &signs);
                    if let syn::Lit::Str(text) = syn::Lit::new(literal) {
                        self.visit_lit_str(&text);
                    }
                    path.clear();
                    signs.clear();
                }
            }
        }
        self.end(&path, &signs);
    }

    /// Adds a path of tokens, by the signs after it; a variable is none.
    fn end(&mut self, path: &[Ident], signs: &str) {
        let is_alone = path.len() == 1 && !path.iter().any(is_upper);
        let is_before_braces = signs == "::";
        if !is_before_braces && (!is_alone || signs == "(" || signs.starts_with("::*")) {
            self.add(Kind::Path, path);
        }
    }
}

impl<'a> Visit<'a> for Reader {
    fn visit_attribute(&mut self, node: &'a Attribute) {
        if !node.path().is_ident("doc") {
            let outer = std::mem::replace(&mut self.in_attribute, true);
            visit::visit_attribute(self, node);
            self.in_attribute = outer;
        }
    }

    fn visit_item_mod(&mut self, node: &'a syn::ItemMod) {
        let outer = self.in_test;
        self.in_test |= node.attrs.iter().any(is_for_tests);
        if self.in_test && node.content.is_none() {
            self.add(Kind::TestFile, std::slice::from_ref(&node.ident));
        }
        self.scope.push(plain(&node.ident));
        visit::visit_item_mod(self, node);
        self.scope.pop();
        self.in_test = outer;
    }

    fn visit_item_use(&mut self, node: &'a syn::ItemUse) {
        let is_export = !matches!(node.vis, syn::Visibility::Inherited);
        for (names, name, at) in branches(&node.tree, &[]) {
            self.add_at(Kind::Import { name, is_export }, names, at);
        }
    }

    /// Leaves out `pub(in super::super)`, which uses nothing.
    fn visit_vis_restricted(&mut self, _: &'a syn::VisRestricted) {}

    fn visit_path(&mut self, node: &'a syn::Path) {
        let names = names(node);
        if names.len() > 1 || names.iter().all(is_upper) {
            self.add(Kind::Path, &names);
        }
        visit::visit_path(self, node);
    }

    fn visit_expr_call(&mut self, node: &'a syn::ExprCall) {
        if let syn::Expr::Path(called) = &*node.func
            && let Some(name) = called.path.get_ident()
        {
            self.add(Kind::Path, std::slice::from_ref(name));
        }
        visit::visit_expr_call(self, node);
    }

    fn visit_macro(&mut self, node: &'a syn::Macro) {
        self.add(Kind::Macro, &names(&node.path));
        self.visit_token_stream(&node.tokens);
    }

    fn visit_token_stream(&mut self, node: &'a TokenStream) {
        self.tokens(node, &[]);
    }

    /// Reads a text: one of an attribute may be a path, as in `#[serde(with = "super::text")]`.
    fn visit_lit_str(&mut self, node: &LitStr) {
        if !self.in_attribute {
            self.add_at(Kind::Text, vec![node.value()], node.span());
        } else if let Ok(path) = node.parse() {
            self.add(Kind::Path, &names(&path));
        }
    }

    fn visit_expr_await(&mut self, node: &'a syn::ExprAwait) {
        self.add_at(Kind::Await, Vec::new(), node.await_token.span);
        visit::visit_expr_await(self, node);
    }

    fn visit_item_macro(&mut self, node: &'a syn::ItemMacro) {
        self.add(Kind::Function, node.ident.as_slice());
        visit::visit_item_macro(self, node);
    }

    fn visit_signature(&mut self, node: &'a syn::Signature) {
        self.add(Kind::Function, std::slice::from_ref(&node.ident));
        visit::visit_signature(self, node);
    }
}

/// The number of lines with code, outside of modules for tests.
fn code_lines(file: &syn::File, tokens: TokenStream) -> usize {
    let mut lines = BTreeSet::new();
    add_lines(tokens, &mut lines);
    for item in &file.items {
        if let syn::Item::Mod(module) = item
            && let Some((braces, _)) = &module.content
            && let Some(first) = module.attrs.iter().find(|attribute| is_for_tests(attribute))
        {
            let module = first.pound_token.span.start().line..=braces.span.close().end().line;
            lines.retain(|line| !module.contains(line));
        }
    }
    lines.len()
}

/// Adds the lines of all tokens but those of documentation.
fn add_lines(tokens: TokenStream, lines: &mut BTreeSet<usize>) {
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        if matches!(&token, TokenTree::Punct(sign) if sign.as_char() == '#') {
            let is_sign = |token: &TokenTree| matches!(token, TokenTree::Punct(sign) if sign.as_char() == '!');
            let inner = tokens.next_if(is_sign);
            if tokens.next_if(is_documentation).is_some() {
                continue;
            }
            lines.extend(inner.iter().flat_map(|sign| lines_of(sign.span())));
        }
        match token {
            TokenTree::Group(group) => {
                lines.extend([group.span_open(), group.span_close()].into_iter().flat_map(lines_of));
                add_lines(group.stream(), lines);
            }
            token => lines.extend(lines_of(token.span())),
        }
    }
}

/// Whether a token is the `[doc = …]` that a comment of documentation stands for.
fn is_documentation(token: &TokenTree) -> bool {
    match token {
        TokenTree::Group(group) => {
            matches!(group.stream().into_iter().next(), Some(TokenTree::Ident(name)) if name == "doc")
        }
        _ => false,
    }
}

fn lines_of(span: Span) -> RangeInclusive<usize> {
    span.start().line..=span.end().line
}

/// The paths of a `use`, each with the name that it brings in; each begins with the names `before`.
fn branches(tree: &UseTree, before: &[String]) -> Vec<(Vec<String>, String, Span)> {
    let with = |name: &str| [before, &[name.to_owned()]].concat();
    let whole = |name: &Ident| match before {
        [_, ..] if name == "self" => before.to_vec(),
        _ => with(&plain(name)),
    };
    match tree {
        UseTree::Path(path) => branches(&path.tree, &with(&plain(&path.ident))),
        UseTree::Group(group) => group.items.iter().flat_map(|tree| branches(tree, before)).collect(),
        UseTree::Name(name) => {
            let path = whole(&name.ident);
            let brings = path.last().cloned().unwrap_or_default();
            vec![(path, brings, name.ident.span())]
        }
        UseTree::Rename(name) => {
            vec![(whole(&name.ident), plain(&name.rename), name.ident.span())]
        }
        UseTree::Glob(glob) => vec![(with("*"), String::new(), glob.star_token.span)],
    }
}

/// Whether an attribute is `#[cfg(test)]`, or `#[cfg(all(…))]` with `test` in it.
fn is_for_tests(attribute: &Attribute) -> bool {
    fn needs_test(meta: &Meta) -> bool {
        match meta {
            Meta::Path(path) => path.is_ident("test"),
            Meta::List(list) if list.path.is_ident("all") => list
                .parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated)
                .is_ok_and(|all| all.iter().any(needs_test)),
            _ => false,
        }
    }
    let is_condition = attribute.path().is_ident("cfg");
    is_condition && attribute.parse_args().is_ok_and(|meta| needs_test(&meta))
}

/// Whether a name is one of a type or a constant; other names alone may be variables.
fn is_upper(name: &Ident) -> bool {
    name.to_string().starts_with(char::is_uppercase)
}

fn names(path: &syn::Path) -> Vec<Ident> {
    path.segments.iter().map(|one| one.ident.clone()).collect()
}

/// A name without the `r#` of a keyword.
fn plain(name: &Ident) -> String {
    name.unraw().to_string()
}
