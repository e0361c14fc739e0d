# What Doxygen cannot read in our Markdown: it knows no anchors of headings, and colours (#c02818) look like links to it.
s/\[([^]]*)\]\(#[^)]*\)/\1/g
s/(\.md)#[^)]*\)/\1)/g
s/(^|[^`&])#([0-9a-f]{6})/\1\\#\2/g
