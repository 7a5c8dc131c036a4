#![cfg_attr(any(doc, doctest), doc = include_str!("conformance.md"))]
#![cfg_attr(
    not(any(doc, doctest)),
    doc = "Each definition of the paper, with the item that implements it."
)]
