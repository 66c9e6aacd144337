// HTML that cannot be broken by what is put into it: text is escaped where it becomes HTML.
#ifndef LITAGS_CLIENT_REPORT_HTML_H_
#define LITAGS_CLIENT_REPORT_HTML_H_

#include <string>
#include <string_view>
#include <vector>

namespace litags::report {

struct Attribute {
  std::string_view name;  // a constant
  std::string value;      // escaped
};

// A piece of a page: text or elements. Only El() and Literal() make markup.
class Html {
 public:
  Html() = default;
  // Text, escaped; see Printable() for characters that are not shown.
  Html(std::string_view text);  // NOLINT(google-explicit-constructor)
  Html(const std::string& text) : Html(std::string_view(text)) {}  // NOLINT
  Html(const char* text) : Html(std::string_view(text)) {}         // NOLINT

  // Markup of ours, as it is: a constant of the program, never a text that was read.
  template <size_t N>
  static Html Literal(const char (&markup)[N]) {
    Html html;
    html.markup_.assign(markup, N - 1);
    return html;
  }

  Html& operator+=(const Html& more);
  const std::string& markup() const { return markup_; }

 private:
  friend Html El(std::string_view tag, const std::vector<Attribute>& attributes,
                 const std::vector<Html>& children);
  std::string markup_;
};

// El("p", {{"class", "note"}}, {"a < b"}). `tag` is a constant.
Html El(std::string_view tag, const std::vector<Attribute>& attributes = {},
        const std::vector<Html>& children = {});

// A name and its value, in a <dl>; nothing without a value.
Html Fact(const std::string& name, const std::string& value);

// "12.5": a length of a drawing, as its attributes take it.
std::string Px(double value);

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_HTML_H_
