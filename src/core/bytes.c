/* Little-endian bytes whatever the machine, and FNV-1a. */
#include "core/bytes.h"

#include <stdlib.h>
#include <string.h>

uint64_t sphm_hash_bytes(uint64_t hash, const void *data, size_t size) {
    const unsigned char *byte = data;
    for (size_t i = 0; i < size; ++i)
        hash = (hash ^ byte[i]) * 1099511628211u;
    return hash;
}

/* The number's bits, whatever its size. */
static uint64_t bits_of(const void *number, size_t size) {
    uint8_t u1;
    uint16_t u2;
    uint32_t u4;
    uint64_t u8;
    switch (size) {
    case 1:
        memcpy(&u1, number, 1);
        return u1;
    case 2:
        memcpy(&u2, number, 2);
        return u2;
    case 4:
        memcpy(&u4, number, 4);
        return u4;
    default:
        memcpy(&u8, number, 8);
        return u8;
    }
}

static void put(unsigned char *bytes, const void *number, size_t size) {
    const uint64_t bits = bits_of(number, size);
    for (size_t i = 0; i < size && i < sizeof bits; ++i)
        bytes[i] = (unsigned char)(bits >> (8 * i));
}

uint64_t sphm_hash_numbers(uint64_t hash, const void *data, size_t count, size_t size) {
    unsigned char bytes[8];
    for (size_t i = 0; i < count; ++i) {
        put(bytes, (const unsigned char *)data + i * size, size);
        hash = sphm_hash_bytes(hash, bytes, size);
    }
    return hash;
}

/* Room for `size` more bytes, or NULL. */
static unsigned char *extend(sphm_writer *writer, size_t size) {
    if (writer->lost)
        return NULL;
    if (writer->size + size > writer->capacity) {
        const size_t capacity = 2 * writer->capacity + size + 256;
        unsigned char *data = realloc(writer->data, capacity);
        if (!data) {
            writer->lost = 1;
            return NULL;
        }
        writer->data = data;
        writer->capacity = capacity;
    }
    unsigned char *place = writer->data + writer->size;
    writer->size += size;
    return place;
}

void sphm_write_bytes(sphm_writer *writer, const void *data, size_t size) {
    unsigned char *place = extend(writer, size);
    if (place && size)
        memcpy(place, data, size);
}

void sphm_write_number(sphm_writer *writer, const void *number, size_t size) {
    unsigned char *place = extend(writer, size);
    if (place)
        put(place, number, size);
}

void sphm_write_u32(sphm_writer *writer, uint32_t value) {
    sphm_write_number(writer, &value, sizeof value);
}
void sphm_write_u64(sphm_writer *writer, uint64_t value) {
    sphm_write_number(writer, &value, sizeof value);
}
void sphm_write_double(sphm_writer *writer, double value) {
    sphm_write_number(writer, &value, sizeof value);
}

void sphm_write_text(sphm_writer *writer, const char *text) {
    sphm_write_u32(writer, (uint32_t)strlen(text));
    sphm_write_bytes(writer, text, strlen(text));
}

void sphm_read_number(sphm_reader *reader, void *number, size_t size) {
    uint64_t bits = 0;
    if (reader->short_of || size > reader->size - reader->at)
        reader->short_of = 1;
    else
        for (size_t i = 0; i < size; ++i)
            bits |= (uint64_t)reader->data[reader->at++] << (8 * i);
    const uint8_t u1 = (uint8_t)bits;
    const uint16_t u2 = (uint16_t)bits;
    const uint32_t u4 = (uint32_t)bits;
    memcpy(number,
           size == 1   ? (const void *)&u1
           : size == 2 ? (const void *)&u2
           : size == 4 ? (const void *)&u4
                       : &bits,
           size);
}

uint32_t sphm_read_u32(sphm_reader *reader) {
    uint32_t value;
    sphm_read_number(reader, &value, sizeof value);
    return value;
}

uint64_t sphm_read_u64(sphm_reader *reader) {
    uint64_t value;
    sphm_read_number(reader, &value, sizeof value);
    return value;
}

double sphm_read_double(sphm_reader *reader) {
    double value;
    sphm_read_number(reader, &value, sizeof value);
    return value;
}

void sphm_read_text(sphm_reader *reader, char *text, size_t size) {
    const uint32_t length = sphm_read_u32(reader);
    text[0] = 0;
    if (reader->short_of || length >= size || length > reader->size - reader->at) {
        reader->short_of = 1;
        return;
    }
    memcpy(text, reader->data + reader->at, length);
    text[length] = 0;
    reader->at += length;
}
