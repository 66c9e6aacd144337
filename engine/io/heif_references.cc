#include "engine/io/heif_references.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr int kMostInChain = 8;  // a grid in an overlay, turned, is three. Choice
constexpr int64_t kMostPictures = int64_t{1} << 17;  // a grid has 65,536 at most

using References = std::map<uint32_t, std::vector<uint32_t>>;  // item to those it is made of

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

void AddReferences(std::string_view iref, References* all) {
  if (iref.size() < 4) return;
  const bool wide = iref[0] != 0;
  ForBoxes(iref.substr(4), [&](std::string_view type, std::string_view content) {
    ByteReader reader(content);
    uint32_t from = 0, to = 0;
    uint16_t count = 0;
    if (type != "dimg" || !ReadId(wide, &reader, &from) || !reader.ReadBig(&count)) return;
    for (int i = 0; i < count && ReadId(wide, &reader, &to); ++i) (*all)[from].push_back(to);
  });
}

References ReferencesOf(std::string_view bytes) {
  References all;
  ForBoxes(bytes, [&](std::string_view type, std::string_view meta) {
    if (type != "meta" || meta.size() < 4) return;
    ForBoxes(meta.substr(4), [&](std::string_view inner, std::string_view content) {
      if (inner == "iref") AddReferences(content, &all);
    });
  });
  return all;
}

// False: the chain of pictures is longer than `links`, or `budget` is used up.
bool Ends(const References& references, uint32_t item, int links, int64_t* budget) {
  if (links < 0 || --*budget < 0) return false;
  const auto made_of = references.find(item);
  if (made_of == references.end()) return true;
  return std::all_of(made_of->second.begin(), made_of->second.end(),
                     [&](uint32_t part) { return Ends(references, part, links - 1, budget); });
}

}  // namespace

bool HeifReferencesEnd(std::string_view bytes) {
  const References references = ReferencesOf(bytes);
  int64_t budget = kMostPictures;
  return std::all_of(references.begin(), references.end(), [&](const auto& item) {
    return Ends(references, item.first, kMostInChain, &budget);
  });
}

}  // namespace litags
