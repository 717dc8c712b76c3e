"""Text of files in any usual encoding."""

BYTE_ORDER_MARKS = (
    (b'\xef\xbb\xbf', 'utf-8-sig', 'UTF-8'),
    (b'\xff\xfe', 'utf-16', 'UTF-16'),
    (b'\xfe\xff', 'utf-16', 'UTF-16'),
)


def decoded(content: bytes) -> tuple[str, str] | None:
    """The text and the encoding's name: by its mark, else UTF-8, else cp1252; None if no text."""
    tried = [(codec, name) for mark, codec, name in BYTE_ORDER_MARKS if content.startswith(mark)]
    if not tried:
        # Without a mark, UTF-16 of Western text has a zero in every other byte.
        zeros = [content[start::2].count(0) for start in (0, 1)]
        if max(zeros) > len(content) // 4:
            tried = [('utf-16-be' if zeros[0] > zeros[1] else 'utf-16-le', 'UTF-16')]
        else:
            tried = [('utf-8', 'UTF-8'), ('cp1252', 'cp1252')]
    for codec, name in tried:
        try:
            text = content.decode(codec)
        except UnicodeDecodeError:
            continue
        if '\0' not in text:
            return text, name
    return None
