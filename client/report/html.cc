#include "client/report/html.h"

#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "client/report/text.h"

namespace litags::report {
namespace {

// For text and for values between double quotes.
std::string Escaped(std::string_view text) {
  return absl::StrReplaceAll(
      Printable(text),
      {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

// Elements that have no end tag.
bool IsVoid(std::string_view tag) {
  constexpr std::array<std::string_view, 4> kVoid = {"br", "img", "link", "meta"};
  return std::find(kVoid.begin(), kVoid.end(), tag) != kVoid.end();
}

}  // namespace

Html::Html(std::string_view text) : markup_(Escaped(text)) {}

Html& Html::operator+=(const Html& more) {
  markup_ += more.markup_;
  return *this;
}

Html El(std::string_view tag, const std::vector<Attribute>& attributes,
        const std::vector<Html>& children) {
  Html html;
  const std::string name(tag);
  absl::StrAppend(&html.markup_, "<", name);
  for (const Attribute& attribute : attributes) {
    absl::StrAppend(&html.markup_, " ", std::string(attribute.name), "=\"",
                    Escaped(attribute.value), "\"");
  }
  html.markup_ += '>';
  if (IsVoid(tag)) return html;
  for (const Html& child : children) html += child;
  absl::StrAppend(&html.markup_, "</", name, ">");
  return html;
}

Html Fact(const std::string& name, const std::string& value) {
  if (value.empty()) return {};
  return El("div", {}, {El("dt", {}, {name}), El("dd", {}, {value})});
}

std::string Px(double value) { return absl::StrFormat("%.1f", value); }

}  // namespace litags::report
