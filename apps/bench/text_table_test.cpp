// SPDX-License-Identifier: Apache-2.0
#include "bench/text_table.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

const TextTable kTable = {{"name", "APE"}, {{"a|b\nc", "0.1"}, {"<i>", "& 2"}}, 1};

TEST(TextTable, MarkdownEscapesBarsAndLineBreaks) {
  EXPECT_EQ(markdown_table(kTable), "| name | APE |\n|---|---:|\n| a\\|b c | 0.1 |\n| <i> | & 2 |\n");
}

TEST(TextTable, HtmlEscapesMarkup) {
  const std::string html = html_table(kTable);
  EXPECT_NE(html.find("<td>&lt;i&gt;</td><td class=\"n\">&amp; 2</td>"), std::string::npos) << html;
  EXPECT_EQ(html.find("<i>"), std::string::npos);
}

}  // namespace
}  // namespace dkb
