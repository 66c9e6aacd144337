#include "engine/io/heif_references.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr int kMostInChain = 8;  // a grid in an overlay, turned, is three. Choice
constexpr int64_t kMostPictures = int64_t{1} << 17;  // a grid has 65,536 at most

// An item to those that it is made of, or that it tells something of.
struct Reference {
  std::string_view type;
  uint32_t from = 0;
  std::vector<uint32_t> to = {};
};
using Parts = std::map<uint32_t, std::vector<uint32_t>>;  // item to those that it is made of

// Calls visit(type, content) for each box in a row of them.
template <class Visit>
void ForBoxes(std::string_view bytes, const Visit& visit) {
  ByteReader reader(bytes);
  uint32_t short_size = 0;
  std::string_view type, content;
  while (reader.ReadBig(&short_size) && reader.ReadBytes(4, &type)) {
    uint64_t size = short_size, head = 8;
    if (short_size == 1) {
      if (!reader.ReadBig(&size)) return;
      head = 16;
    }
    if (short_size == 0) size = head + reader.remaining();  // to the end of the file
    if (size < head || !reader.ReadBytes(size - head, &content)) return;
    visit(type, content);
  }
}

bool ReadId(bool wide, ByteReader* reader, uint32_t* id) {
  if (wide) return reader->ReadBig(id);
  uint16_t narrow = 0;
  if (!reader->ReadBig(&narrow)) return false;
  *id = narrow;
  return true;
}

bool HasWideIds(std::string_view full_box) { return !full_box.empty() && full_box[0] != 0; }

// As libheif reads them: one behind the other, whatever sizes their boxes state.
std::vector<Reference> ReadReferences(std::string_view iref) {
  std::vector<Reference> all;
  const bool wide = HasWideIds(iref);
  ByteReader reader(iref);
  reader.Skip(4);
  while (true) {
    Reference next;
    uint32_t size = 0, to = 0;
    uint16_t count = 0;
    if (!reader.ReadBig(&size) || !reader.ReadBytes(4, &next.type) ||
        (size == 1 && !reader.Skip(8)) || (next.type == "uuid" && !reader.Skip(16)) ||
        !ReadId(wide, &reader, &next.from) || !reader.ReadBig(&count)) {
      return all;
    }
    while (next.to.size() < count && ReadId(wide, &reader, &to)) next.to.push_back(to);
    all.push_back(std::move(next));
  }
}

// Calls visit(type, content) for each box of the boxes that list a file's items.
template <class Visit>
void ForMetaBoxes(std::string_view bytes, const Visit& visit) {
  ForBoxes(bytes, [&](std::string_view type, std::string_view meta) {
    if (type == "meta" && meta.size() >= 4) ForBoxes(meta.substr(4), visit);
  });
}

Parts PartsOf(std::string_view bytes) {
  Parts parts;
  ForMetaBoxes(bytes, [&](std::string_view type, std::string_view content) {
    if (type != "iref") return;
    for (const Reference& reference : ReadReferences(content)) {
      if (reference.type != "dimg") continue;
      std::vector<uint32_t>& to = parts[reference.from];
      to.insert(to.end(), reference.to.begin(), reference.to.end());
    }
  });
  return parts;
}

uint32_t PrimaryItem(std::string_view bytes) {
  uint32_t primary = 0;
  ForMetaBoxes(bytes, [&](std::string_view type, std::string_view content) {
    ByteReader reader(content);
    if (type == "pitm" && reader.Skip(4)) ReadId(HasWideIds(content), &reader, &primary);
  });
  return primary;
}

void AppendBig(std::string* out, size_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) out->push_back(static_cast<char>(value >> 8 * i));
}

void AppendBox(std::string* out, std::string_view type, std::string_view content) {
  AppendBig(out, 8 + content.size(), 4);
  out->append(type).append(content);
}

// Those of an "iref" that the primary picture needs. `with_metadata`: also those that tell of it.
std::string NeededReferences(std::string_view iref, uint32_t primary, bool with_metadata) {
  const int id_bytes = HasWideIds(iref) ? 4 : 2;
  std::string needed(iref.substr(0, 4));
  for (Reference& reference : ReadReferences(iref)) {
    std::vector<uint32_t>& to = reference.to;
    const bool tells = with_metadata && reference.type == "cdsc" &&
                       std::find(to.begin(), to.end(), primary) != to.end();
    if (tells) to = {primary};
    if (!tells && reference.type != "dimg") continue;
    std::string content;
    AppendBig(&content, reference.from, id_bytes);
    AppendBig(&content, to.size(), 2);
    for (const uint32_t item : to) AppendBig(&content, item, id_bytes);
    AppendBox(&needed, reference.type, content);
  }
  return needed;
}

// False: the chain of pictures is longer than `links`, or `budget` is used up.
bool Ends(const Parts& parts, uint32_t item, int links, int64_t* budget) {
  if (links < 0 || --*budget < 0) return false;
  const auto made_of = parts.find(item);
  if (made_of == parts.end()) return true;
  return std::all_of(made_of->second.begin(), made_of->second.end(),
                     [&](uint32_t part) { return Ends(parts, part, links - 1, budget); });
}

}  // namespace

bool HeifReferencesEnd(std::string_view bytes) {
  const Parts parts = PartsOf(bytes);
  int64_t budget = kMostPictures;
  return std::all_of(parts.begin(), parts.end(), [&](const auto& item) {
    return Ends(parts, item.first, kMostInChain, &budget);
  });
}

std::string WithoutOtherPictures(std::string_view bytes) {
  constexpr size_t kHead = 8;  // of a box
  std::string copy;
  const uint32_t primary = PrimaryItem(bytes);
  ForMetaBoxes(bytes, [&](std::string_view type, std::string_view content) {
    if (type != "iref" || content.size() < 4) return;
    const size_t start = type.data() - 4 - bytes.data();
    const size_t size = content.data() + content.size() - bytes.data() - start;
    std::string needed = NeededReferences(content, primary, true);
    // No other box fits into what is left.
    if (const size_t left = size - kHead - needed.size(); left > 0 && left < kHead) {
      needed = NeededReferences(content, primary, false);
    }
    const size_t left = size - kHead - needed.size();
    if (left < kHead) return;
    std::string boxes;
    AppendBox(&boxes, type, needed);
    AppendBox(&boxes, "free", std::string(left - kHead, '\0'));
    if (copy.empty()) copy = bytes;
    copy.replace(start, size, boxes);
  });
  return copy;
}

}  // namespace litags
